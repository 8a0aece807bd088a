"""`footfall robot new`: a robot folder out of another maker's URDF or MJCF."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from foreign_robots import BIPED_MJCF, HIPS, quadruped
from scipy.spatial.transform import Rotation

from footfall.cli import main
from footfall.common.errors import UserError
from footfall.deploy.drivers.mit import RANGES
from footfall.policies.controllers.settings import configured_controllers, controller_settings
from footfall.policies.controllers.stand import StandConfig
from footfall.robots.description import Robot, load_robot
from footfall.robots.importer.build import build_machine
from footfall.robots.importer.create import Imported, ImportRequest, import_robot
from footfall.robots.importer.feet import leg_names
from footfall.robots.importer.machine import Leg
from footfall.robots.importer.meshes import read_points
from footfall.robots.importer.motors import choose_drive, with_armature
from footfall.robots.importer.read import read_source
from footfall.robots.importer.shapes import Kind, fit_shape, fit_sole, rotation_of
from footfall.robots.importer.statics import Statics, statics

PELVIS = 1


def make(tmp_path: Path, text: str, suffix: str = "urdf", **wishes: object) -> tuple[Robot, Imported]:
    """Write a model, import it, load what came of it."""
    source = tmp_path / f"model.{suffix}"
    source.write_text(text)
    made = import_robot(ImportRequest(source, tmp_path / "made", RANGES, **wishes))
    return load_robot(made.folder), made


@pytest.fixture(scope="module")
def four(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Imported]:
    return make(tmp_path_factory.mktemp("four"), quadruped())


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Imported]:
    return make(tmp_path_factory.mktemp("two"), BIPED_MJCF, "xml")


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """No lying pose is looked for, which takes seconds (tests/plant/test_lying.py)."""
    monkeypatch.setattr("footfall.plant.lying.find_lying_pose", lambda _: None)


class TestWhatIsKept:
    def test_the_joints_in_the_order_of_the_tree(self, four: tuple[Robot, Imported]) -> None:
        robot, _ = four
        assert robot.joint_names == tuple(f"{leg}_{part}" for leg in HIPS for part in ("roll", "hip", "knee"))
        assert [foot.name for foot in robot.description.feet] == list(HIPS)
        assert robot.description.feet[2].joints == ("RL_roll", "RL_hip", "RL_knee")

    def test_limits_torque_and_speed_of_each_joint(self, four: tuple[Robot, Imported]) -> None:
        robot, _ = four
        knee = robot.joint_index("RR_knee")
        assert (robot.lower_rad[knee], robot.upper_rad[knee]) == pytest.approx((-2.33, -0.4))
        assert robot.motor.peak_torque[:3] == pytest.approx([21.0, 22.0, 23.0])
        assert robot.motor.no_load_speed[3:6] == pytest.approx([15.0, 16.0, 17.0])

    def test_friction_and_damping_become_the_joint_laws(self, four: tuple[Robot, Imported]) -> None:
        robot, _ = four
        assert robot.motor.damping[:3] == pytest.approx([0.11, 0.12, 0.13])
        assert robot.motor.friction[:3] == pytest.approx([0.21, 0.22, 0.23])

    def test_the_moving_masses(self, four: tuple[Robot, Imported], tmp_path: Path) -> None:
        """The mass matrix in a pose drawn at random is that of the source, without reflected inertia.

        The source has a link without mass between two joints, tilted and fixed parts, and an arm that the
        robot holds rigid.
        """
        robot, _ = four
        (tmp_path / "model.urdf").write_text(quadruped())
        theirs = read_source(tmp_path / "model.urdf").model
        ours = mujoco.MjModel.from_xml_path(str(robot.xml_path))
        pose = dict(zip(robot.joint_names, np.random.default_rng(3).uniform(-1, 1, 12), strict=True))
        wanted = mass_matrix(theirs, {**pose, "arm": 0.4}, robot.joint_names)
        assert mass_matrix(ours, pose, robot.joint_names) == pytest.approx(wanted, abs=1e-5)

    def test_a_urdf_says_nothing_of_friction(self, four: tuple[Robot, Imported]) -> None:
        robot, made = four
        model = mujoco.MjModel.from_xml_path(str(robot.xml_path))
        feet = [model.geom(foot.geoms[0]) for foot in robot.description.feet]
        assert [(foot.friction[0], foot.priority[0]) for foot in feet] == [(0.8, 1)] * 4
        assert "friction of the feet on the ground: 0.8" in made.guesses

    def test_an_imu_where_the_file_has_one(self, four: tuple[Robot, Imported]) -> None:
        model = mujoco.MjModel.from_xml_path(str(four[0].xml_path))
        assert model.site("imu").pos == pytest.approx([0.03, -0.02, 0.05])

    def test_a_given_reflected_inertia(self, two: tuple[Robot, Imported]) -> None:
        robot, made = two
        assert robot.armature[robot.joint_index("left_knee")] == pytest.approx(0.03)
        assert not any("reflected inertia" in guess for guess in made.guesses)

    def test_torques_of_actuators(self, two: tuple[Robot, Imported]) -> None:
        """A gear of 40 and a control range of 1.5; a force range of 70; a joint's own limit of 50."""
        robot, _ = two
        names = ("left_hip", "left_knee", "left_ankle")
        peak = [robot.motor.peak_torque[robot.joint_index(name)] for name in names]
        assert peak == pytest.approx([60.0, 70.0, 50.0])


class TestWhatIsMade:
    def test_feet_that_touch_together_within_the_soft_limits(self, four: tuple[Robot, Imported]) -> None:
        robot, _ = four
        assert np.ptp(robot.foot_places[:, 2]) < 2e-3
        low, high = robot.soft_limits
        assert (low < robot.default_pose).all()
        assert (robot.default_pose < high).all()

    def test_a_pose_with_the_centre_of_mass_above_the_feet(self, four: tuple[Robot, Imported]) -> None:
        robot, _ = four
        model = mujoco.MjModel.from_xml_path(str(robot.xml_path))
        data = mujoco.MjData(model)
        for name, angle in zip(robot.joint_names, robot.default_pose, strict=True):
            data.joint(name).qpos = angle
        mujoco.mj_forward(model, data)
        away = data.subtree_com[1] - data.xpos[1] - robot.foot_places.mean(axis=0)
        assert away[:2] == pytest.approx([0.0, 0.0], abs=0.01)

    def test_the_other_side_mirrored_to_the_last_digit(self, two: tuple[Robot, Imported]) -> None:
        robot, _ = two
        left = [robot.default_pose[robot.joint_index(f"left_{part}")] for part in ("roll", "hip", "knee")]
        right = [robot.default_pose[robot.joint_index(f"right_{part}")] for part in ("roll", "hip", "knee")]
        assert right == [-left[0] + 0.0, left[1], left[2]]

    def test_knees_that_may_bend_either_way_bend_forward_on_two_legs(self, tmp_path: Path) -> None:
        either = BIPED_MJCF.replace('range="0 2.2"', 'range="-2.2 2.2"').replace("-1.8 0.6", "-1.8 1.8")
        robot, _ = make(tmp_path, either, "xml")
        assert robot.default_pose[robot.joint_index("left_knee")] > 0.2

    def test_knees_that_bend_backward_are_told(self, tmp_path: Path) -> None:
        """On two legs they are likely those of a model whose x axis points backward."""
        backward = BIPED_MJCF.replace('range="0 2.2"', 'range="-2.2 0"').replace("-1.8 0.6", "-0.6 1.8")
        _, made = make(tmp_path, backward, "xml")
        assert any("knees bend backward" in guess for guess in made.guesses)

    def test_a_keyframe_that_stands_is_the_default_pose(self, tmp_path: Path) -> None:
        """By its name, beside another one; a knee beyond the soft limits comes back within them."""
        joints = ("0.1 0.05 -0.4 0.9 -0.5 -0.05", "-0.1 -0.05 -0.3 0.0 -0.4 0.05")
        keys = "".join(
            f'<key name="{name}" qpos="0 0 1 1 0 0 0 {left} {right}"/>'
            for name, left, right in (("fallen", "0 0 0 1 0 0", "0 0 0 1 0 0"), ("home", *joints))
        )
        text = BIPED_MJCF.replace("</mujoco>", f"<keyframe>{keys}</keyframe></mujoco>")
        robot, _ = make(tmp_path, text, "xml")
        assert robot.default_pose[:6] == pytest.approx([0.1, 0.05, -0.4, 0.9, -0.5, -0.05])
        assert robot.default_pose[9] == pytest.approx(0.03 * 2.2, abs=1e-4)

    def test_a_sole_becomes_its_corners(self, two: tuple[Robot, Imported]) -> None:
        """Of a box of 0.24 by 0.1 m whose middle is 0.03 m before the ankle; within its outline."""
        robot, _ = two
        model = mujoco.MjModel.from_xml_path(str(robot.xml_path))
        feet = robot.description.feet[0].geoms
        assert len(feet) == 4
        places = np.array([model.geom(name).pos for name in feet])
        radius = model.geom(feet[0]).size[0]
        assert sorted(set(places[:, 0].round(6))) == pytest.approx([-0.09 + radius, 0.15 - radius])
        assert sorted(set(places[:, 1].round(6))) == pytest.approx([-0.05 + radius, 0.05 - radius])
        assert places[:, 2] - radius == pytest.approx(np.full(4, -0.06))

    def test_a_thin_shank_ends_in_a_ball(self, tmp_path: Path) -> None:
        """A cylinder of radius 0.015 m from the knee down to 0.31 m: its end is where the ball touches."""
        shank = '<collision><origin xyz="0 0 -0.155"/><geometry><cylinder radius="0.015" length="0.31"/>'
        robot, _ = make(tmp_path, quadruped(foot=shank + "</geometry></collision>"))
        model = mujoco.MjModel.from_xml_path(str(robot.xml_path))
        ball = model.geom(robot.description.feet[0].geoms[0])
        assert ball.type[0] == Kind.mjGEOM_SPHERE
        assert ball.pos[2] - ball.size[0] == pytest.approx(-0.31, abs=2e-3)

    def test_balls_beside_a_rod_are_the_foot(self, tmp_path: Path) -> None:
        """Three balls of unlike sizes that reach 0.06 m down, a rod between them ends 4 mm higher."""
        balls = "".join(
            f'<geom type="sphere" pos="{x} {y} {r - 0.06}" size="{r}" mass="0.2"/>'
            for x, y, r in ((0.14, 0.03, 0.006), (0.13, -0.03, 0.008), (-0.07, 0.0, 0.01))
        )
        rod = '<geom type="capsule" fromto="-0.05 0 -0.046 0.1 0 -0.046" size="0.01" mass="0.1"/>'
        text = re.sub(r'<geom type="box" pos="0.03[^>]*/>', rod + balls, BIPED_MJCF)
        robot, _ = make(tmp_path, text, "xml")
        model = mujoco.MjModel.from_xml_path(str(robot.xml_path))
        for foot in robot.description.feet:
            assert [float(model.geom(name).size[0]) for name in foot.geoms] == [0.006, 0.008, 0.01]
        assert ((model.geom_type == Kind.mjGEOM_CAPSULE) & (model.geom_contype != 0)).sum() == 2 * 3

    def test_the_gains_let_no_joint_sag(self, tmp_path: Path) -> None:
        """3 N m on the last joint, 0.12 rad at most: 25 N m/rad, where 4 N m motors alone would have 5.3."""
        (tmp_path / "m.urdf").write_text(quadruped())
        source = read_source(tmp_path / "m.urdf")
        machine, _ = build_machine(source, "dog")
        peak = dict.fromkeys((hinge.name for hinge in machine.hinges), 4.0)
        machine, _ = with_armature(machine, peak, {})
        torque = np.append(np.zeros(11), -3.0)
        drive = choose_drive(machine, source, peak, {}, Statics(torque, np.zeros((0, 0)), np.zeros((12, 0))))
        kp = 1.7e-4 * 4.0 * (2 * np.pi * drive.natural_frequency_hz) ** 2
        assert 25.0 <= kp < 27.0

    def test_reflected_inertia_is_estimated_from_the_torque_and_said_to_be(
        self, four: tuple[Robot, Imported]
    ) -> None:
        robot, made = four
        assert robot.armature[:3] == pytest.approx(1.7e-4 * np.array([21.0, 22.0, 23.0]))
        assert any("reflected inertia" in guess and "--armature" in guess for guess in made.guesses)
        assert "reflected inertia" in (made.folder / "robot.yaml").read_text()

    def test_motors_share_no_address(self, four: tuple[Robot, Imported]) -> None:
        """No more of them on a bus than it carries."""
        joints = four[0].description.joints
        assert len({(joint.bus, joint.id) for joint in joints}) == len(joints)
        assert max(joint.id for joint in joints) <= 3

    def test_links_that_meet_in_the_default_pose_are_kept_apart(self, tmp_path: Path) -> None:
        """Front thighs as wide as that reach into each other, the hind ones do not."""
        wide = '<collision><geometry><sphere radius="0.12"/></geometry></collision>'
        robot, _ = make(tmp_path, quadruped(thigh=wide))
        excluded = re.findall(r'<exclude body1="(\w+)" body2="(\w+)"', robot.xml_path.read_text())
        assert excluded == [("FL_thigh", "FR_thigh")]

    def test_everything_that_was_guessed_is_told(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str], quick: None
    ) -> None:
        (tmp_path / "m.urdf").write_text(quadruped())
        assert main(["robot", "new", "--from", str(tmp_path / "m.urdf"), "--out", str(tmp_path / "dog")]) == 0
        told = capsys.readouterr().out
        for word in (
            "feet:",
            "reflected inertia",
            "rigid",
            "IMU",
            "placeholders",
            "forward",
            "default pose",
            "lying pose",
        ):
            assert word in told, word
        assert load_robot(tmp_path / "dog").name == "dog"


class TestWishes:
    def test_a_torque_by_part_of_a_joints_name(self, tmp_path: Path) -> None:
        """The longest part that fits counts; joints that nobody names keep the file's."""
        wishes = {"knee": 11.0, "RR_knee": 12.5}
        robot, _ = make(
            tmp_path, quadruped(), peak_torque_nm=wishes, armature={"": 0.006}, speed_rad_s={"hip": 7.0}
        )
        peak = dict(zip(robot.joint_names, robot.motor.peak_torque, strict=True))
        assert (peak["FL_knee"], peak["RR_knee"], peak["FL_roll"]) == (11.0, 12.5, 21.0)
        assert robot.armature == pytest.approx(np.full(12, 0.006))
        assert robot.motor.no_load_speed[:3] == pytest.approx([15.0, 7.0, 17.0])

    def test_feet_by_name(self, tmp_path: Path) -> None:
        feet = ("FL_shank", "FR_shank", "RL_shank")
        robot, _ = make(tmp_path, quadruped(), feet=feet)
        assert [foot.name for foot in robot.description.feet] == ["FL", "FR", "RL"]
        assert len(robot.joint_names) == 9

    def test_from_the_command_line(self, tmp_path: Path, quick: None) -> None:
        (tmp_path / "m.urdf").write_text(quadruped())
        arguments = ["--from", str(tmp_path / "m.urdf"), "--out", str(tmp_path / "dog")]
        assert main(["robot", "new", *arguments, "--peak-torque", "hip=9,knee=10.5"]) == 0
        robot = load_robot(tmp_path / "dog")
        assert robot.motor.peak_torque[:3] == pytest.approx([21.0, 9.0, 10.5])


class TestMeshes:
    OBJ = (
        "".join(f"v {x} {y} {z}\n" for x in (0.05, 0.35) for y in (-0.02, 0.06) for z in (-0.41, -0.21))
        + "f 1 2 3\nf 4 5 6\nf 6 7 8\nf 1 4 8\n"
    )

    def test_are_found_in_packages_and_not_needed_afterwards(self, tmp_path: Path) -> None:
        (tmp_path / "elsewhere/maker/meshes").mkdir(parents=True)
        (tmp_path / "elsewhere/maker/meshes/foot.obj").write_text(self.OBJ)
        mesh = '<collision><geometry><mesh filename="package://maker/meshes/foot.obj" scale="0.1 0.1 1"/>'
        text = quadruped(foot=mesh + "</geometry></collision>")
        robot, _ = make(tmp_path, text, packages=(tmp_path / "elsewhere",))
        assert mujoco.MjModel.from_xml_path(str(robot.xml_path)).nmesh == 0
        assert -robot.foot_places[0, 2] > 0.3

    def test_beside_the_urdf(self, tmp_path: Path) -> None:
        (tmp_path / "foot.obj").write_text(self.OBJ)
        foot = '<collision><geometry><mesh filename="foot.obj"/></geometry></collision>'
        (tmp_path / "m.urdf").write_text(quadruped(foot=foot))
        points = next(iter(read_source(tmp_path / "m.urdf").meshes.values()))
        assert points.max(axis=0) == pytest.approx([0.35, 0.06, -0.21])

    def test_stl_as_text(self, tmp_path: Path) -> None:
        (tmp_path / "a.stl").write_text(
            "solid a\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\nvertex 4 5.5 6\nvertex -1 0 1e-1\n"
        )
        points = read_points(tmp_path / "a.stl", np.array([1.0, 2.0, -1.0]))
        assert points == pytest.approx(np.array([[1, 4, -3], [4, 11, -6], [-1, 0, -0.1]]))

    def test_collada_through_its_scene(self, tmp_path: Path) -> None:
        """In centimetres; moved by (10, 0, 5) after a quarter turn about z."""
        (tmp_path / "a.dae").write_text(
            """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
            <asset><unit meter="0.01"/></asset>
            <library_geometries><geometry id="g"><mesh><source id="p"><float_array>1 2 3 4 5 6</float_array>
            </source><vertices id="v"><input semantic="POSITION" source="#p"/></vertices></mesh></geometry>
            </library_geometries><library_visual_scenes><visual_scene><node><translate>10 0 5</translate>
            <rotate>0 0 1 90</rotate><instance_geometry url="#g"/></node></visual_scene>
            </library_visual_scenes></COLLADA>"""
        )
        points = read_points(tmp_path / "a.dae", np.ones(3))
        assert points == pytest.approx(np.array([[0.08, 0.01, 0.08], [0.05, 0.04, 0.11]]))


class TestShapes:
    TURN = Rotation.from_euler("xyz", [0.4, -0.7, 1.1]).as_matrix()
    PLACE = np.array([0.3, -0.2, 0.5])

    def cloud(self) -> np.ndarray:
        points = np.random.default_rng(1).normal(size=(6000, 3))
        return points / np.linalg.norm(points, axis=1, keepdims=True)

    def test_a_ball(self) -> None:
        shape, error = fit_shape(0.07 * self.cloud() + self.PLACE)
        assert shape.kind == Kind.mjGEOM_SPHERE
        assert shape.size[0] == pytest.approx(0.07, rel=0.01)
        assert shape.position == pytest.approx(self.PLACE, abs=1e-3)
        assert error < 1e-3

    def test_a_slanting_rod(self) -> None:
        points = 0.02 * self.cloud()
        points[:, 2] += 0.1 * np.sign(points[:, 2])
        shape, _ = fit_shape(points @ self.TURN.T + self.PLACE)
        assert shape.kind == Kind.mjGEOM_CAPSULE
        assert shape.size[:2] == pytest.approx([0.02, 0.1], rel=0.03)
        assert abs(rotation_of(shape.quaternion)[:, 2] @ self.TURN[:, 2]) == pytest.approx(1.0, abs=1e-3)

    def test_a_brick_along_the_links_axes(self) -> None:
        corners = np.array([[x, y, z] for x in (0.0, 0.2) for y in (0.0, 0.3) for z in (0.0, 0.05)])
        shape, _ = fit_shape(corners)
        assert shape.kind == Kind.mjGEOM_BOX
        assert shape.size == pytest.approx([0.1, 0.15, 0.025])
        assert shape.position == pytest.approx([0.1, 0.15, 0.025])

    def test_a_sole_is_as_large_as_what_lies_on_the_ground(self) -> None:
        """Of a shoe with a wider shaft, seen from a link whose x axis points down."""
        bottom = np.array([[0.4, y, z] for y in (-0.03, 0.05) for z in (-0.1, 0.14)])
        shaft = np.array([[0.2, y, z] for y in (-0.2, 0.2) for z in (-0.2, 0.2)])
        shape = fit_sole(np.concatenate([bottom, shaft]), up=np.array([-1.0, 0.0, 0.0]))
        extent = np.abs(rotation_of(shape.quaternion)) @ shape.size
        assert extent == pytest.approx([0.01, 0.04, 0.12])
        assert shape.position == pytest.approx([0.39, 0.01, 0.02])


class TestStatics:
    @pytest.fixture
    def model(self) -> mujoco.MjModel:
        """A body of 10 kg, its centre 0.5 m above two ankles, on soles of four balls without weight."""
        foot = '<geom name="{0}{1}" type="sphere" size="0.01" pos="{2} {3} -0.04" mass="1e-6"/>'
        corners = [(0.1, 0.03), (0.1, -0.03), (-0.1, 0.03), (-0.1, -0.03)]
        feet = "".join(
            f'<body pos="0 {y} -0.5"><joint name="{name}" axis="0 1 0"/>'
            + "".join(foot.format(name, i, *corner) for i, corner in enumerate(corners))
            + "</body>"
            for name, y in (("left", 0.1), ("right", -0.1))
        )
        body = f'<body pos="0 0 0.55"><freejoint/><geom type="box" size=".1 .1 .1" mass="10"/>{feet}</body>'
        return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{body}</worldbody></mujoco>")

    def legs(self) -> tuple[Leg, ...]:
        return tuple(
            Leg(name, (name,), 1, tuple(f"{name}{i}" for i in range(4))) for name in ("left", "right")
        )

    def test_ankles_must_be_stiffer_than_weight_times_height(self, model: mujoco.MjModel) -> None:
        """An inverted pendulum: 10 kg * 9.81 m/s2 * 0.5 m = 49.05 N m/rad of both together."""
        found = statics(model, ("left", "right"), self.legs(), model.qpos0)
        assert not found.stable(np.array([30.0, 18.0]))
        assert found.stable(np.array([30.0, 20.0]))

    def test_points_alone_do_not_stand(self, model: mujoco.MjModel) -> None:
        legs = tuple(Leg(leg.name, leg.joints, 1, leg.geoms[:1]) for leg in self.legs())
        found = statics(model, ("left", "right"), legs, model.qpos0)
        assert not found.stable(np.array([1e4, 1e4]))

    def test_torque_is_force_times_distance(self, model: mujoco.MjModel) -> None:
        """With the body 0.03 m before the ankles, they share 10 * 9.81 * 0.03 N m."""
        model.body_ipos[PELVIS, 0] = 0.03
        mujoco.mj_setConst(model, mujoco.MjData(model))
        found = statics(model, ("left", "right"), self.legs(), model.qpos0)
        assert abs(found.torque_nm.sum()) == pytest.approx(10 * 9.81 * 0.03, rel=1e-3)


class TestRefusals:
    """One line, exit status 2, and nothing written."""

    KNEE = '<limit lower="-2.3{0}" upper="-0.4" effort="2{0}" velocity="1{0}"/>'

    @pytest.mark.parametrize(
        ("text", "reason"),
        [
            ("hello", "neither URDF nor MJCF"),
            ("<html/>", "its root is <html>"),
            ('<robot name="r"/>', "has no links"),
            (
                '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include/><link name="a"/></robot>',
                "is a xacro",
            ),
            ("<mujoco/>", "has no joints"),
            ("<mujoco><worldbody><bodyx/></worldbody></mujoco>", "unrecognized element"),
            (
                '<mujoco><worldbody><body><joint type="slide"/><geom size="1"/></body></worldbody></mujoco>',
                "no free joint",
            ),
            (quadruped(knee_limit='<limit effort="3" velocity="2"/>'), "knee of a leg has no limits"),
            (quadruped(knee_limit='<limit lower="-2" upper="-1"/>'), "FL_knee has no peak torque (effort)"),
            (
                quadruped(knee_limit='<limit lower="-2" upper="-1" effort="1000"/>'),
                "is no motor's on a machine",
            ),
            (quadruped(knee_kind="prismatic"), "is a slide joint"),
            (quadruped(knee_extra='<mimic joint="FL_hip"/>'), "follows another one"),
            (quadruped(foot=""), "FL_shank carries a foot, but no collision geometry"),
            (
                quadruped(
                    foot='<collision><geometry><mesh filename="package://p/x.stl"/></geometry></collision>'
                ),
                "no mesh file for 'package://p/x.stl'",
            ),
            (quadruped(shank_mass=0.0), "FL_shank moves and has no mass"),
            (quadruped(upside_down=True), "no feet found"),
            (quadruped().replace('"FR_roll"', '"FL_roll"'), "2 joints are called 'FL_roll'"),
            (quadruped().replace('value="5.3"', 'value="heavy"'), "expected three numbers"),
            (
                quadruped().replace('<child link="FL_shank"/>', '<child link="nix"/>'),
                "parent or child missing",
            ),
        ],
    )
    def test_of_a_file_that_is_no_legged_machine(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, reason: str
    ) -> None:
        (tmp_path / "m.xml").write_text(text)
        assert main(["robot", "new", "--from", str(tmp_path / "m.xml"), "--out", str(tmp_path / "made")]) == 2
        complaint = capsys.readouterr().err
        assert reason in complaint
        assert complaint.count("\n") == 1
        assert [path.name for path in tmp_path.iterdir()] == ["m.xml"]

    def test_of_closed_loops(self, tmp_path: Path) -> None:
        rod = '<connect name="rod" body1="pelvis" body2="left_foot" anchor="0 0 0"/>'
        loop = f"<equality>{rod}</equality></mujoco>"
        with pytest.raises(UserError, match="equality rod closes a loop"):
            make(tmp_path, BIPED_MJCF.replace("</mujoco>", loop), "xml")

    def test_of_a_folder_that_exists(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (tmp_path / "m.urdf").write_text(quadruped())
        (tmp_path / "mine").mkdir()
        (tmp_path / "mine/robot.yaml").write_text("precious")
        assert (
            main(["robot", "new", "--from", str(tmp_path / "m.urdf"), "--out", str(tmp_path / "mine")]) == 2
        )
        assert "exists already" in capsys.readouterr().err
        assert (tmp_path / "mine/robot.yaml").read_text() == "precious"

    @pytest.mark.parametrize(
        ("option", "value", "reason"),
        [
            ("--peak-torque", "a=b", "expected a number above 0"),
            ("--armature", "-1", "expected a number above 0"),
            ("--speed", "wrist=3", "no joint has 'wrist' in its name"),
            ("--feet", "FL_shank,nix", "no link 'nix'"),
            ("--feet", "FL_shank,trunk", "no end of a limb is 'trunk'"),
        ],
    )
    def test_of_wishes_that_fit_nothing(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str], option: str, value: str, reason: str
    ) -> None:
        (tmp_path / "m.urdf").write_text(quadruped())
        arguments = ["--from", str(tmp_path / "m.urdf"), "--out", str(tmp_path / "made")]
        assert main(["robot", "new", *arguments, option, value]) == 2
        assert reason in capsys.readouterr().err

    def test_a_continuous_joint_is_given_a_range_instead(self, tmp_path: Path) -> None:
        text = quadruped(knee_kind="continuous", knee_limit='<limit effort="23" velocity="17"/>')
        robot, made = make(tmp_path, text)
        assert robot.upper_rad[2] == pytest.approx(np.pi)
        assert any("continuous" in guess for guess in made.guesses)


@pytest.mark.parametrize(
    ("ends", "names"),
    [
        (["FL_calf", "FR_calf"], ["FL", "FR"]),
        (["leg_left_6_link", "leg_right_6_link"], ["left", "right"]),
        (["a", "b_c"], ["a", "b_c"]),
    ],
)
def test_legs_are_called_by_what_tells_them_apart(ends: list[str], names: list[str]) -> None:
    assert leg_names(ends) == names


def mass_matrix(model: mujoco.MjModel, pose: dict[str, float], joints: tuple[str, ...]) -> np.ndarray:
    """Of the base, then of the joints, in the order given."""
    model.dof_armature[:] = 0.0
    data = mujoco.MjData(model)
    for name, angle in pose.items():
        data.joint(name).qpos = angle
    mujoco.mj_forward(model, data)
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    dofs = [*range(6), *(int(model.joint(name).dofadr[0]) for name in joints)]
    return full[np.ix_(dofs, dofs)]


class TestControllers:
    def test_a_quadruped_may_be_stood_up_with_the_gains_of_its_stiffest_joint(
        self, four: tuple[Robot, Imported]
    ) -> None:
        robot, _ = four
        settings = controller_settings(robot, "stand", StandConfig)
        assert settings.kp == pytest.approx(robot.kp.max(), rel=1e-3)
        assert settings.kd == pytest.approx(robot.kd.max(), rel=1e-3)

    def test_a_biped_is_offered_none(self, two: tuple[Robot, Imported]) -> None:
        assert configured_controllers(two[0]) == {}

    def test_commands_follow_from_the_length_of_the_legs(
        self, four: tuple[Robot, Imported], two: tuple[Robot, Imported]
    ) -> None:
        """0.45 and 0.25 of sqrt(g L): legs of about 0.42 m and 0.69 m."""
        assert four[0].description.commands.forward_m_s == (-0.9, 0.9)
        assert two[0].description.commands.forward_m_s == (-0.7, 0.7)
