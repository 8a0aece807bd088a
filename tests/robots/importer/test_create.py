"""`footfall robot new`: a robot folder from another maker's URDF or MJCF."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from foreign_robots import BIPED_MJCF, HIPS, make, quadruped
from posed import mass_matrix
from refused import refusal_of

from footfall.cli import main
from footfall.deploy.drivers.mit import RANGES
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stand import StandConfig
from footfall.policies.registry import controllers_of, load_policy
from footfall.robots.description import Robot, load_robot
from footfall.robots.importer.create import Imported, ImportRequest, import_robot
from footfall.robots.importer.read import read_source
from footfall.train.config import load_preset


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip the search for a lying pose, which takes seconds (tests/plant/test_standing.py)."""
    monkeypatch.setattr("footfall.plant.lying.find_lying_pose", lambda _: None)


def test_joints_are_in_the_order_of_the_tree(four: tuple[Robot, Imported]) -> None:
    robot, _ = four
    assert robot.joint_names == tuple(f"{leg}_{part}" for leg in HIPS for part in ("roll", "hip", "knee"))
    assert [foot.name for foot in robot.description.feet] == list(HIPS)
    assert robot.description.feet[2].joints == ("RL_roll", "RL_hip", "RL_knee")


def test_each_joint_has_its_limits_torque_speed_and_losses(four: tuple[Robot, Imported]) -> None:
    robot, _ = four
    assert robot.motor.damping[:3] == pytest.approx([0.11, 0.12, 0.13])
    assert robot.motor.friction[:3] == pytest.approx([0.21, 0.22, 0.23])
    knee = robot.joint_index("RR_knee")
    assert (robot.lower_rad[knee], robot.upper_rad[knee]) == pytest.approx((-2.33, -0.4))
    assert robot.motor.peak_torque[:3] == pytest.approx([21.0, 22.0, 23.0])
    assert robot.motor.no_load_speed[3:6] == pytest.approx([15.0, 16.0, 17.0])


def test_the_mass_matrix_equals_the_sources(four: tuple[Robot, Imported], tmp_path: Path) -> None:
    """The mass matrix in a pose drawn at random is that of the source, without reflected inertia.

    The source has a link without mass between two joints, tilted and fixed parts, and an arm that the
    robot holds rigid.
    """
    robot, _ = four
    (tmp_path / "model.urdf").write_text(quadruped())
    original = read_source(tmp_path / "model.urdf").model
    converted = mujoco.MjModel.from_xml_path(str(robot.xml_path))
    pose = dict(zip(robot.joint_names, np.random.default_rng(3).uniform(-1, 1, 12), strict=True))
    expected = rigid_mass(original, {**pose, "arm": 0.4}, robot.joint_names)
    assert rigid_mass(converted, pose, robot.joint_names) == pytest.approx(expected, abs=1e-5)


def test_a_given_reflected_inertia_is_used(two: tuple[Robot, Imported]) -> None:
    robot, made = two
    assert robot.armature[robot.joint_index("left_knee")] == pytest.approx(0.03)
    assert not any("reflected inertia" in guess for guess in made.guesses)


def test_feet_touch_together_within_the_soft_limits(four: tuple[Robot, Imported]) -> None:
    robot, _ = four
    assert np.ptp(robot.foot_positions[:, 2]) < 2e-3
    low, high = robot.soft_limits
    assert (low < robot.default_pose).all()
    assert (robot.default_pose < high).all()


def test_the_right_side_is_the_mirrored_left_side_to_the_last_digit(two: tuple[Robot, Imported]) -> None:
    robot, _ = two
    left = [robot.default_pose[robot.joint_index(f"left_{part}")] for part in ("roll", "hip", "knee")]
    right = [robot.default_pose[robot.joint_index(f"right_{part}")] for part in ("roll", "hip", "knee")]
    assert right == [-left[0] + 0.0, left[1], left[2]]


def test_knees_that_may_bend_either_way_bend_forward_on_two_legs(tmp_path: Path) -> None:
    either = BIPED_MJCF.replace('range="0 2.2"', 'range="-2.2 2.2"').replace("-1.8 0.6", "-1.8 1.8")
    robot, _ = make(tmp_path, either, "xml")
    assert robot.default_pose[robot.joint_index("left_knee")] > 0.2


def test_knees_that_bend_backward_are_noted(tmp_path: Path) -> None:
    """If a biped's knees bend backward, the model's x axis probably points backward."""
    backward = BIPED_MJCF.replace('range="0 2.2"', 'range="-2.2 0"').replace("-1.8 0.6", "-0.6 1.8")
    _, made = make(tmp_path, backward, "xml")
    assert any("knees bend backward" in guess for guess in made.guesses)


def test_a_keyframe_that_stands_is_the_default_pose(tmp_path: Path) -> None:
    """The key is found by its name; a knee beyond the soft limits is moved inside them."""
    joints = ("0.1 0.05 -0.4 0.9 -0.5 -0.05", "-0.1 -0.05 -0.3 0.0 -0.4 0.05")
    keys = "".join(
        f'<key name="{name}" qpos="0 0 1 1 0 0 0 {left} {right}"/>'
        for name, left, right in (("fallen", "0 0 0 1 0 0", "0 0 0 1 0 0"), ("home", *joints))
    )
    text = BIPED_MJCF.replace("</mujoco>", f"<keyframe>{keys}</keyframe></mujoco>")
    robot, _ = make(tmp_path, text, "xml")
    assert robot.default_pose[:6] == pytest.approx([0.1, 0.05, -0.4, 0.9, -0.5, -0.05])
    assert robot.default_pose[9] == pytest.approx(0.03 * 2.2, abs=1e-4)


def test_a_biped_with_point_feet_is_held_up_at_first(two: tuple[Robot, Imported], tmp_path: Path) -> None:
    sole = '<geom type="box" pos="0.03 0 -0.045" size="0.12 0.05 0.015" mass="0.6"/>'
    sphere = '<geom type="sphere" pos="0 0 -0.04" size="0.02" mass="0.6"/>'
    robot, made = make(tmp_path, BIPED_MJCF.replace(sole, sphere), "xml")
    assert robot.description.held_start
    assert load_preset("cpu", robot).env.commands.standing_command == 0.0
    assert any("held up" in guess for guess in made.guesses)
    assert not two[0].description.held_start


def test_reflected_inertia_is_estimated_from_the_torque(four: tuple[Robot, Imported]) -> None:
    robot, made = four
    assert robot.armature[:3] == pytest.approx(1.7e-4 * np.array([21.0, 22.0, 23.0]))
    assert any("reflected inertia" in guess and "--armature" in guess for guess in made.guesses)
    assert "reflected inertia" in (made.folder / "robot.yaml").read_text()


def test_links_that_touch_in_the_default_pose_are_excluded(tmp_path: Path) -> None:
    """Front thighs of this width overlap, hind thighs do not."""
    wide = '<collision><geometry><sphere radius="0.12"/></geometry></collision>'
    robot, _ = make(tmp_path, quadruped(thigh=wide))
    excluded = re.findall(r'<exclude body1="(\w+)" body2="(\w+)"', robot.xml_path.read_text())
    assert excluded == [("FL_thigh", "FR_thigh")]


def test_guesses_are_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str], quick: None) -> None:
    (tmp_path / "m.urdf").write_text(quadruped())
    assert main(["robot", "new", "--from", str(tmp_path / "m.urdf"), "--out", str(tmp_path / "dog")]) == 0
    result = capsys.readouterr().out
    for word in ("reflected inertia", "rigid", "IMU", "placeholders", "forward", "lying pose"):
        assert word in result, word
    assert load_robot(tmp_path / "dog").name == "dog"


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


@pytest.fixture
def refusal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """The line of a refusal, which has exit status 2 and writes no file."""

    def refuse(text: str, *options: str) -> str:
        (tmp_path / "m.xml").write_text(text)
        arguments = ["--from", str(tmp_path / "m.xml"), "--out", str(tmp_path / "made")]
        assert main(["robot", "new", *arguments, *options]) == 2
        assert [path.name for path in tmp_path.iterdir()] == ["m.xml"]
        complaint = capsys.readouterr().err
        assert complaint.count("\n") == 1
        return complaint

    return refuse


def test_a_file_without_a_legged_robot_is_refused(refusal: Callable[..., str]) -> None:
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
    ):
        assert reason in refusal(text)


def test_options_that_match_no_joint_or_link_are_refused(refusal: Callable[..., str]) -> None:
    for option, value, named in (
        ("--peak-torque", "a=b", "positive"),
        ("--armature", "-1", "positive"),
        ("--speed", "wrist=3", "'wrist'"),
        ("--feet", "FL_shank,nix", "'nix'"),
        ("--feet", "FL_shank,trunk", "'trunk'"),
    ):
        assert named in refusal(quadruped(), option, value)


def test_an_existing_folder_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "m.urdf").write_text(quadruped())
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/robot.yaml").write_text("precious")
    arguments = ["--from", str(tmp_path / "m.urdf"), "--out", str(tmp_path / "mine")]
    assert main(["robot", "new", *arguments]) == 2
    assert str(tmp_path / "mine") in capsys.readouterr().err
    assert (tmp_path / "mine/robot.yaml").read_text() == "precious"


def test_a_continuous_joint_is_given_a_range_instead(tmp_path: Path) -> None:
    text = quadruped(knee_kind="continuous", knee_limit='<limit effort="23" velocity="17"/>')
    robot, made = make(tmp_path, text)
    assert robot.upper_rad[2] == pytest.approx(np.pi)
    (guess,) = (guess for guess in made.guesses if "without limits" in guess)
    assert all(f"{leg}_knee" in guess for leg in HIPS)


def rigid_mass(model: mujoco.MjModel, pose: dict[str, float], joints: tuple[str, ...]) -> np.ndarray:
    """The mass matrix of the base and of the joints, in the order given, without reflected inertia."""
    model.dof_armature[:] = 0.0
    data = mujoco.MjData(model)
    for name, angle in pose.items():
        data.joint(name).qpos = angle
    mujoco.mj_forward(model, data)
    return mass_matrix(model, data, joints)


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


def import_request(tmp_path: Path, folder: str = "made", **options: Any) -> ImportRequest:
    (tmp_path / "m.urdf").write_text(quadruped())
    return ImportRequest(tmp_path / "m.urdf", tmp_path / folder, RANGES, **options)


def test_the_folders_parents_are_created_and_the_robot_has_its_name(tmp_path: Path) -> None:
    made = import_robot(import_request(tmp_path, "new/deep/my dog-2_x"))
    assert made.folder == tmp_path / "new/deep/my dog-2_x"
    assert load_robot(made.folder).name == "my_dog-2_x"
    assert [path.name for path in made.folder.parent.iterdir()] == ["my dog-2_x"]


def test_a_robot_that_cannot_be_loaded_leaves_no_folder(tmp_path: Path) -> None:
    """The joints have so much damping that the plant's steps are unstable."""
    request = import_request(tmp_path)
    request.source.write_text(quadruped().replace('damping="0.1', 'damping="900.1'))
    message = refusal_of(import_robot, request)
    assert message.startswith(f"{request.source}: joint ")  # no file of the folder, which is gone
    assert "damping" in message
    assert [path.name for path in tmp_path.iterdir()] == ["m.urdf"]


def test_torques_beyond_every_protocol_are_noted(tmp_path: Path) -> None:
    made = import_robot(import_request(tmp_path, peak_torque_nm={"FL_knee": 900.0}))
    assert any("FL_knee" in guess and "protocol" in guess for guess in made.guesses)
    plain = import_robot(import_request(tmp_path, "plain"))
    assert not any("no protocol has" in guess or "pairs of links" in guess for guess in plain.guesses)
    assert plain.guesses[0] == "base: 'trunk', its x axis pointing forward, z up"
    assert any(guess.startswith("gains: a natural frequency") for guess in plain.guesses)
