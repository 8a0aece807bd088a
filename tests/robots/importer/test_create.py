"""`footfall robot new`: a robot folder from another maker's URDF or MJCF."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from foreign_robots import BIPED_MJCF, HIPS, make, quadruped, read
from posed import mass_matrix
from shell import Shell

from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stand import StandConfig
from footfall.policies.registry import controllers_of, load_policy
from footfall.robots.description import Robot, load_robot
from footfall.robots.importer.create import Imported
from footfall.train.config import load_preset


def test_joints_have_the_order_of_the_tree_and_the_files_limits_torques_speeds_and_losses(
    four: tuple[Robot, Imported],
) -> None:
    robot, _ = four
    joints = {leg: tuple(f"{leg}_{part}" for part in ("roll", "hip", "knee")) for leg in HIPS}
    assert [(foot.name, foot.joints) for foot in robot.description.feet] == list(joints.items())
    assert robot.joint_names == sum(joints.values(), ())
    assert robot.motor.damping[:3] == pytest.approx([0.11, 0.12, 0.13])
    assert robot.motor.friction[:3] == pytest.approx([0.21, 0.22, 0.23])
    assert (robot.lower_rad[11], robot.upper_rad[11]) == pytest.approx((-2.33, -0.4))
    assert robot.motor.peak_torque[:3] == pytest.approx([21.0, 22.0, 23.0])
    assert robot.motor.no_load_speed[3:6] == pytest.approx([15.0, 16.0, 17.0])


def test_the_mass_matrix_equals_the_sources(four: tuple[Robot, Imported], tmp_path: Path) -> None:
    """The mass matrix in a pose drawn at random is that of the source, without reflected inertia.

    The source has a link without mass between two joints, tilted and fixed parts, and an arm that the
    robot holds rigid.
    """
    robot, _ = four
    original = read(tmp_path, quadruped()).model
    converted = mujoco.MjModel.from_xml_path(str(robot.xml_path))
    pose = dict(zip(robot.joint_names, np.random.default_rng(3).uniform(-1, 1, 12), strict=True))
    matrices = []
    for model, angles in ((original, {**pose, "arm": 0.4}), (converted, pose)):
        model.dof_armature[:] = 0.0
        data = mujoco.MjData(model)
        for name, angle in angles.items():
            data.joint(name).qpos = angle
        mujoco.mj_forward(model, data)
        matrices.append(mass_matrix(model, data, robot.joint_names))
    assert matrices[1] == pytest.approx(matrices[0], abs=1e-5)


def test_reflected_inertia_is_the_files_or_estimated_from_the_torque(
    four: tuple[Robot, Imported], two: tuple[Robot, Imported]
) -> None:
    robot, made = four
    assert robot.armature[:3] == pytest.approx(1.7e-4 * np.array([21.0, 22.0, 23.0]))
    assert any("reflected inertia" in guess and "--armature" in guess for guess in made.guesses)
    assert "reflected inertia" in (made.folder / "robot.yaml").read_text()
    robot, made = two
    assert robot.armature[robot.joint_index("left_knee")] == pytest.approx(0.03)
    assert not any("reflected inertia" in guess for guess in made.guesses)


def test_the_default_pose_is_level_within_the_soft_limits_and_symmetric_to_the_last_digit(
    four: tuple[Robot, Imported], two: tuple[Robot, Imported]
) -> None:
    robot, _ = four
    assert np.ptp(robot.foot_positions[:, 2]) < 2e-3
    low, high = robot.soft_limits
    assert ((low < robot.default_pose) & (robot.default_pose < high)).all()
    angles = dict(zip(two[0].joint_names, two[0].default_pose, strict=True))
    left, right = (
        [angles[f"{side}_{part}"] for part in ("roll", "hip", "knee")] for side in ("left", "right")
    )
    assert right == [-left[0] + 0.0, left[1], left[2]]


def test_knees_that_may_bend_either_way_bend_forward_on_two_legs(tmp_path: Path) -> None:
    """If a biped's knees bend backward, the model's x axis probably points backward, which is noted."""
    for knee, hip, forward in (("-2.2 2.2", "-1.8 1.8", True), ("-2.2 0", "-0.6 1.8", False)):
        robot, made = make(tmp_path, BIPED_MJCF.replace("0 2.2", knee).replace("-1.8 0.6", hip))
        assert (robot.default_pose[robot.joint_index("left_knee")] > 0.2) == forward
        assert any("knees bend backward" in guess for guess in made.guesses) != forward


def test_a_keyframe_that_stands_is_the_default_pose(tmp_path: Path) -> None:
    """The key is found by its name; a knee beyond the soft limits is moved inside them."""
    joints = ("0.1 0.05 -0.4 0.9 -0.5 -0.05", "-0.1 -0.05 -0.3 0.0 -0.4 0.05")
    keys = "".join(
        f'<key name="{name}" qpos="0 0 1 1 0 0 0 {left} {right}"/>'
        for name, left, right in (("fallen", "0 0 0 1 0 0", "0 0 0 1 0 0"), ("home", *joints))
    )
    text = BIPED_MJCF.replace("</mujoco>", f"<keyframe>{keys}</keyframe></mujoco>")
    robot, _ = make(tmp_path, text)
    assert robot.default_pose[:6] == pytest.approx([0.1, 0.05, -0.4, 0.9, -0.5, -0.05])
    assert robot.default_pose[9] == pytest.approx(0.03 * 2.2, abs=1e-4)


def test_a_biped_with_point_feet_is_held_up_at_first(two: tuple[Robot, Imported], tmp_path: Path) -> None:
    sole = '<geom type="box" pos="0.03 0 -0.045" size="0.12 0.05 0.015" mass="0.6"/>'
    sphere = '<geom type="sphere" pos="0 0 -0.04" size="0.02" mass="0.6"/>'
    robot, made = make(tmp_path, BIPED_MJCF.replace(sole, sphere))
    assert robot.description.held_start
    assert load_preset("cpu", robot).env.commands.standing_command == 0.0
    assert any("held up" in guess for guess in made.guesses)
    assert not two[0].description.held_start


def test_links_that_touch_in_the_default_pose_are_excluded(tmp_path: Path) -> None:
    """Front thighs of this width overlap, hind thighs do not."""
    wide = '<collision><geometry><sphere radius="0.12"/></geometry></collision>'
    robot, _ = make(tmp_path, quadruped(thigh=wide))
    excluded = re.findall(r'<exclude body1="(\w+)" body2="(\w+)"', robot.xml_path.read_text())
    assert excluded == [("FL_thigh", "FR_thigh")]


def test_guesses_are_printed_and_the_folders_parents_created(
    shell: Shell, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the search for a lying pose, which takes seconds (tests/plant/test_standing.py)."""
    monkeypatch.setattr("footfall.plant.lying.find_lying_pose", lambda _: None)
    Path("m.urdf").write_text(quadruped())
    result = shell("robot", "new", "--from", "m.urdf", "--out", "new/deep/my dog-2_x")
    assert result.status == 0
    for word in ("reflected inertia", "rigid", "IMU", "placeholders", "forward", "lying pose"):
        assert word in result.out, word
    assert load_robot(Path("new/deep/my dog-2_x")).name == "my_dog-2_x"
    assert [path.name for path in Path("new/deep").iterdir()] == ["my dog-2_x"]


def test_a_torque_is_given_by_a_part_of_a_joints_name(tmp_path: Path) -> None:
    """The longest matching part counts; other joints keep the file's torque."""
    options = {"knee": 11.0, "RR_knee": 12.5}
    robot, _ = make(
        tmp_path, quadruped(), peak_torque_nm=options, armature={"": 0.006}, speed_rad_s={"hip": 7.0}
    )
    peak = dict(zip(robot.joint_names, robot.motor.peak_torque, strict=True))
    assert (peak["FL_knee"], peak["RR_knee"], peak["FL_roll"]) == (11.0, 12.5, 21.0)
    assert robot.armature == pytest.approx(np.full(12, 0.006))
    assert robot.motor.no_load_speed[:3] == pytest.approx([15.0, 7.0, 17.0])


def refusal(shell: Shell, text: str, *options: str) -> str:
    """The line of a refusal, which writes no file."""
    Path("m.xml").write_text(text)
    complaint = shell.refuses("robot", "new", "--from", "m.xml", "--out", "made", *options)
    assert [path.name for path in Path().iterdir()] == ["m.xml"]
    return complaint


def test_a_file_without_a_legged_robot_is_refused(shell: Shell) -> None:
    xacro = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
    slide = '<mujoco><worldbody><body><joint type="slide"/><geom size="1"/></body></worldbody></mujoco>'
    mesh = '<collision><geometry><mesh filename="package://p/x.stl"/></geometry></collision>'
    dog = quadruped()
    for text, reason in (
        ("hello", "neither URDF nor MJCF"),
        ("<html/>", "<html>"),
        ('<robot name="r"/>', "no links"),
        (f'<robot {xacro}><xacro:include/><link name="a"/></robot>', "xacro"),
        ("<mujoco/>", "no joints"),
        ("<mujoco><worldbody><bodyx/></worldbody></mujoco>", "unrecognized element"),
        (slide, "no free joint"),
        (quadruped(knee_limit='<limit lower="-2" upper="-1"/>'), "FL_knee has no peak torque"),
        (quadruped(knee_limit='<limit lower="-2" upper="-1" effort="1000"/>'), "FL_knee"),
        (quadruped(knee_kind="prismatic"), "slide joint"),
        (quadruped(knee_extra='<mimic joint="FL_hip"/>'), "follows another one"),
        (quadruped(foot=""), "FL_shank carries a foot"),
        (quadruped(foot=mesh), "'package://p/x.stl'"),
        (quadruped(shank_mass=0.0), "FL_shank moves and has no mass"),
        (quadruped(upside_down=True), "no feet found"),
        (dog.replace('"FR_roll"', '"FL_roll"'), "'FL_roll'"),
        (dog.replace('value="5.3"', 'value="heavy"'), "three numbers"),
        (dog.replace('<child link="FL_shank"/>', '<child link="nix"/>'), "parent or child"),
        # The plant's steps are unstable; the message names no file of the folder, which is gone.
        (dog.replace('damping="0.1', 'damping="900.1'), "m.xml: joint RL_knee: kd"),
    ):
        assert reason in refusal(shell, text)


def test_options_that_match_no_joint_or_link_are_refused(shell: Shell) -> None:
    for option, value, named in (
        ("--peak-torque", "a=b", "positive"), ("--armature", "-1", "positive"),
        ("--speed", "wrist=3", "'wrist'"), ("--feet", "FL_shank,nix", "'nix'"),
        ("--feet", "FL_shank,trunk", "'trunk'"),
    ):  # fmt: skip
        assert named in refusal(shell, quadruped(), option, value)


def test_an_existing_folder_is_refused(shell: Shell, tmp_path: Path) -> None:
    (tmp_path / "m.urdf").write_text(quadruped())
    mine = tmp_path / "mine/robot.yaml"
    mine.parent.mkdir()
    mine.write_text("precious")
    assert str(mine.parent) in shell.refuses("robot", "new", "--from", "m.urdf", "--out", mine.parent)
    assert mine.read_text() == "precious"


def test_a_continuous_joint_is_given_a_range_instead(tmp_path: Path) -> None:
    text = quadruped(knee_kind="continuous", knee_limit='<limit effort="23" velocity="17"/>')
    robot, made = make(tmp_path, text)
    assert (robot.lower_rad[2], robot.upper_rad[2]) == pytest.approx((-np.pi, np.pi))
    (guess,) = (guess for guess in made.guesses if "without limits" in guess)
    assert all(f"{leg}_knee" in guess for leg in HIPS)


def test_controllers_depend_on_the_number_of_legs(
    four: tuple[Robot, Imported], two: tuple[Robot, Imported]
) -> None:
    for imported, shipped in ((four[0], "go1"), (two[0], "g1")):
        names = controllers_of(imported)
        assert names == controllers_of(load_robot(shipped))
        for name in names:
            load_policy(name, imported)
    robot = four[0]
    assert controller_settings(robot, "stand", StandConfig).kp >= robot.kp.max() * (1.0 - 1e-3)


def test_torques_beyond_every_protocol_are_noted(tmp_path: Path, four: tuple[Robot, Imported]) -> None:
    _, made = make(tmp_path, quadruped(), peak_torque_nm={"FL_knee": 900.0})
    assert any("FL_knee" in guess and "protocol" in guess for guess in made.guesses)
    plain = four[1].guesses
    assert not any("no protocol has" in guess or "pairs of links" in guess for guess in plain)
    assert plain[0] == "base: 'trunk', its x axis pointing forward, z up"
    assert any(guess.startswith("gains: a natural frequency") for guess in plain)
