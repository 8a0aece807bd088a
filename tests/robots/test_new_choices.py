"""What `footfall robot new` chooses: gains, protocols, a pose; and the folder that it writes, by hand."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest
import yaml
from foreign_robots import BIPED_MJCF, ODD, hanging, on_base, quadruped, read

from footfall.common.errors import UserError
from footfall.deploy.drivers.mit import RANGES
from footfall.robots.description import load_robot
from footfall.robots.importer.build import build_machine
from footfall.robots.importer.create import ImportRequest, import_robot
from footfall.robots.importer.machine import Hinge, Leg, Link, Machine
from footfall.robots.importer.model_xml import model_xml
from footfall.robots.importer.motors import Drive, JointMotor, choose_drive, peak_torques
from footfall.robots.importer.pose import LegSearch, Pose, standing_pose
from footfall.robots.importer.robot_yaml import choose_protocols, robot_yaml
from footfall.robots.importer.source import Source
from footfall.robots.importer.statics import Statics, statics

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def rod_machine(torque_free: Sequence[Hinge], legs: tuple[Leg, ...] = ()) -> Machine:
    """A base of 5 kg and a link of 3 kg with some hinges."""
    link = Link("link", 0, np.zeros(3), LEVEL, 3.0, np.zeros(3), np.eye(3), tuple(torque_free), ())
    base = Link("base", -1, np.zeros(3), LEVEL, 5.0, np.zeros(3), np.eye(3), (), ())
    return Machine("m", (base, link), legs, np.zeros(3))


def hinge(name: str, span: float = 2.0, armature: float = 0.01, friction: float = 0.0) -> Hinge:
    return Hinge(
        name, np.array([0.0, 1.0, 0.0]), np.zeros(3), -0.25 * span, 0.75 * span, 0.0, armature, 0.0, friction
    )


def source_of(tmp_path: Path, peak: dict[str, float], speed: dict[str, float] | None = None) -> Source:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    return Source(tmp_path / "m.urdf", model, False, {}, peak, speed or {})


CALM = Statics(np.zeros(3), np.zeros((0, 0)), np.zeros((3, 0)))  # no weight, nothing to tip


class TestDrive:
    HINGES = hinge("a", 0.5), hinge("b"), hinge("c")

    def drive(
        self,
        tmp_path: Path,
        hinges: Sequence[Hinge],
        torque: Sequence[float],
        statics: Statics = CALM,
        wished: dict[str, float] | None = None,
        speed: dict[str, float] | None = None,
    ) -> Drive:
        machine = rod_machine(hinges)
        peak = {each.name: value for each, value in zip(hinges, torque, strict=True)}
        return choose_drive(machine, source_of(tmp_path, peak, speed), peak, wished or {}, statics)

    def test_the_middle_joint_asks_for_its_peak_torque_at_three_quarters_of_a_radian(
        self, tmp_path: Path
    ) -> None:
        """20 N m over 0.01 kg m^2 and 0.75 rad: 51.6 rad/s, 8.2 Hz, of which steps of a half begin at 8."""
        drive = self.drive(tmp_path, self.HINGES, (10.0, 20.0, 90.0))
        assert (drive.natural_frequency_hz, drive.stands) == (8.0, True)

    def test_an_action_moves_no_joint_by_more_than_nine_tenths_of_its_range(self, tmp_path: Path) -> None:
        """kp = 0.01 (2 pi 8)^2 = 25.27 N m/rad; of 0.5 rad and 90 N m that is a share of 0.1263."""
        tight = self.drive(tmp_path, (hinge("a"), hinge("b"), hinge("c", 0.5)), (10.0, 20.0, 90.0))
        assert tight.torque_share == 0.126
        assert self.drive(tmp_path, self.HINGES, (10.0, 20.0, 20.0)).torque_share == 0.3

    def test_stiffness_is_twice_the_least_that_keeps_it_from_tipping(self, tmp_path: Path) -> None:
        """One motion of the second joint, from which gravity takes 10 N m/rad: 20 N m/rad at 7.12 Hz."""
        tipping = Statics(np.zeros(3), np.array([[-10.0]]), np.array([[0.0], [1.0], [0.0]]))
        drive = self.drive(tmp_path, self.HINGES, (1.0, 1.0, 1.0), tipping)
        assert drive.natural_frequency_hz == 7.5
        assert any("7.5 Hz, at which it should stand" in guess for guess in drive.guesses)

    def test_where_nothing_lets_it_stand_the_usual_stiffness_is_taken_and_told(self, tmp_path: Path) -> None:
        tipping = Statics(np.zeros(3), np.array([[-1e9]]), np.array([[0.0], [1.0], [0.0]]))
        drive = self.drive(tmp_path, self.HINGES, (10.0, 20.0, 90.0), tipping)
        assert (drive.natural_frequency_hz, drive.stands) == (8.0, False)
        assert any("no stiffness of the joints lets it stand" in guess for guess in drive.guesses)

    def test_friction_is_ramped_so_that_the_plants_steps_can_follow(self, tmp_path: Path) -> None:
        """3 N m in a step of 1 ms takes 0.3 rad/s of 0.01 kg m^2: three tenths of 1 rad/s."""
        hinges = hinge("a", friction=3.0), hinge("b", friction=0.1), hinge("c", armature=0.04, friction=3.0)
        motors = self.drive(tmp_path, hinges, (20.0, 20.0, 20.0)).motors
        assert [motors[name].friction_speed_rad_s for name in "abc"] == pytest.approx([1.0, 0.2, 0.25])

    def test_speeds_are_as_wished_else_the_files_if_a_motor_has_such(self, tmp_path: Path) -> None:
        drive = self.drive(
            tmp_path, self.HINGES, (20.0,) * 3, wished={"a": 12.0}, speed={"a": 3.0, "b": 59.0, "c": 61.0}
        )
        assert [drive.motors[name].no_load_speed_rad_s for name in "abc"] == [12.0, 59.0, 30.0]
        assert [guess for guess in drive.guesses if "no-load speed of" in guess] == [
            "no-load speed of c: 30 rad/s"
        ]
        unsaid = self.drive(tmp_path, self.HINGES, (20.0,) * 3)
        assert [motor.no_load_speed_rad_s for motor in unsaid.motors.values()] == [30.0] * 3

    def test_that_a_file_says_nothing_of_friction_is_told(self, tmp_path: Path) -> None:
        told = "friction and damping of the joints: none, as the file says nothing"
        assert told in self.drive(tmp_path, self.HINGES, (20.0,) * 3).guesses
        said = hinge("a", friction=0.1), *self.HINGES[1:]
        assert told not in self.drive(tmp_path, said, (20.0,) * 3).guesses

    @pytest.mark.parametrize(("torque", "taken"), [(94.0, True), (95.0, False)])
    def test_a_files_torque_is_at_most_three_times_the_weight_on_the_leg(
        self, tmp_path: Path, torque: float, taken: bool
    ) -> None:
        """8 kg * 9.81 m/s^2 * 0.4 m * 3 = 94.2 N m; what the user says is not doubted."""
        machine = rod_machine(self.HINGES)
        source = source_of(tmp_path, {"a": 10.0, "b": torque, "c": 10.0})
        if taken:
            assert peak_torques(machine, source, {}, 0.4)["b"] == torque
        else:
            with pytest.raises(UserError, match="joint b has a peak torque of 95 N m, which is no motor's"):
                peak_torques(machine, source, {}, 0.4)
        assert peak_torques(machine, source, {"b": 200.0, "": 5.0}, 0.4) == {"a": 5.0, "b": 200.0, "c": 5.0}
        bare = source_of(tmp_path, {"a": 10.0, "c": 10.0})
        assert peak_torques(machine, bare, {"b": 200.0}, 0.4)["b"] == 200.0
        with pytest.raises(UserError, match=r"joint b has no peak torque \(effort\)"):
            peak_torques(machine, bare, {}, 0.4)


class Carries(NamedTuple):
    """What a made-up motor's frames carry."""

    torque: float
    velocity: float = 50.0
    kp: float = 500.0
    kd: float = 5.0


class TestRobotYaml:
    def chosen(self, armature: float = 0.01, **known: Carries) -> tuple[dict[str, str], list[str]]:
        """For a motor of 20 N m and 30 rad/s at 8 Hz, critically damped: kp 25.3, kd 1.005."""
        machine = rod_machine([hinge("a", armature=armature)])
        drive = Drive({"a": JointMotor(20.0, 30.0, 0.2)}, 8.0, 0.3, True, ())
        return choose_protocols(machine, drive, known)

    @pytest.mark.parametrize(
        "lacking",
        [Carries(19.9), Carries(20.0, velocity=29.0), Carries(20.0, kp=25.0), Carries(20.0, kd=1.0)],
    )
    def test_a_joint_gets_the_weakest_motor_whose_frames_carry_all_that_it_needs(
        self, lacking: Carries
    ) -> None:
        chosen = self.chosen(a=Carries(90.0), b=lacking, c=Carries(25.0, kp=25.3, kd=1.01))
        assert chosen == ({"a": "c"}, [])
        assert self.chosen(a=lacking, b=Carries(18.0)) == ({"a": "a"}, ["a"])

    def text(self, legs: int = 2, hinges: int = 9) -> list[str]:
        names = [f"j{k}" for k in range(hinges)]
        own = tuple(Leg(f"leg {k}", tuple(names[1 + 4 * k : 5 + 4 * k]), 1, (f"g{k}",)) for k in range(legs))
        machine = rod_machine([hinge(name) for name in names], own)
        motors = {name: JointMotor(20.0 + (name == "j2"), 30.0 + k, 0.25) for k, name in enumerate(names)}
        pose = Pose(dict.fromkeys(names, 0.12346), 0.34567, 0.0, 0.5)
        return robot_yaml(
            machine, pose, Drive(motors, 8.0, 0.3, True, ()), dict.fromkeys(names, "AK"), []
        ).splitlines()

    def test_each_leg_has_buses_of_its_own_of_three_motors_each(self) -> None:
        joints = [line for line in self.text() if "default_rad" in line]
        places = [line.partition("bus: ")[2].rstrip("}") for line in joints]
        assert places == [
            "can0, id: 1",
            *("can1, id: 1", "can1, id: 2", "can1, id: 3", "can2, id: 1"),
            *("can3, id: 1", "can3, id: 2", "can3, id: 3", "can4, id: 1"),
        ]
        assert "default_rad: 0.1235," in joints[0]

    @pytest.mark.parametrize(
        ("legs", "commands"),
        [
            (2, "commands: {forward_m_s: [-0.6, 0.6], leftward_m_s: [-0.3, 0.3], yaw_rad_s: [-0.6, 0.6]}"),
            (3, "commands: {forward_m_s: [-1.0, 1.0], leftward_m_s: [-0.5, 0.5], yaw_rad_s: [-1.0, 1.0]}"),
        ],
    )
    def test_commands_are_shares_of_the_speed_at_which_legs_of_half_a_metre_fall(
        self, legs: int, commands: str
    ) -> None:
        """sqrt(9.81 * 0.5) = 2.21 m/s: a quarter of it on two legs, 0.45 on more; half as much sideways."""
        assert commands in self.text(legs, 13)

    def test_height_speed_and_motors_are_written_down(self) -> None:
        lines = self.text()
        assert any(line.startswith("standing_height_m: 0.3457 ") for line in lines)
        assert any(line.startswith("target_rate_rad_s: 76 ") for line in lines)  # twice the fastest
        assert lines.count("    friction_speed_rad_s: 0.25") == 9
        assert sum(line.startswith("    stall_torque_nm: 20") for line in lines) == 8

    def test_names_that_yaml_would_take_for_something_else_are_quoted(self) -> None:
        machine = replace(rod_machine([hinge("no"), hinge("1e3"), hinge("Off")]), name="y")
        motors = dict.fromkeys(("no", "1e3", "Off"), JointMotor(20.0, 30.0, 0.2))
        pose = Pose(dict.fromkeys(motors, 0.0), 0.3, 0.0, 0.5)
        text = robot_yaml(
            machine, pose, Drive(motors, 8.0, 0.3, True, ()), dict.fromkeys(motors, "AK"), ["told"]
        )
        content = yaml.safe_load(text)
        assert content["name"] == "y"
        assert [joint["name"] for joint in content["joints"]] == ["no", "1e3", "Off"]
        assert text.startswith("# told\n")


def walker(*, knee: str = "-2 -0.4", more: str = "", legs: Sequence[tuple[str, float, float]] = ()) -> str:
    """Legs of two links of 0.2 m with balls of 0.02 m, hips at the height of the base's origin."""
    places = legs or (("fl", 0.2, 0.1), ("fr", 0.2, -0.1), ("rl", -0.2, 0.1), ("rr", -0.2, -0.1))
    limbs = "".join(
        f"""<body name="{name}_thigh" pos="{x} {y} 0">
          <joint name="{name}_roll" axis="1 0 0" range="-0.8 0.8"/>
          <joint name="{name}_hip" axis="0 1 0" range="-2 2"/>
          <geom type="capsule" fromto="0 0 -.03 0 0 -.15" size="0.01" mass="0.2"/>
          <body name="{name}_shank" pos="0 0 -0.2"><joint name="{name}_knee" axis="0 1 0" range="{knee}"/>
            <geom name="{name}_foot" size="0.02" pos="0 0 -0.2" mass="0.05"/></body></body>"""
        for name, x, y in places
    )
    return on_base(limbs, more)


class TestPose:
    def pose(self, tmp_path: Path, text: str) -> Pose:
        return standing_pose(build_machine(read(tmp_path, text), "m")[0])

    def test_four_legs_stand_at_three_quarters_of_their_reach(self, tmp_path: Path) -> None:
        """A knee of -2 to -0.4 rad may use 0.85 of it, to -0.52: 0.4 cos(0.26) m and the ball's radius."""
        pose = self.pose(tmp_path, walker())
        reach = 0.4 * np.cos(0.26) + 0.02
        assert pose.reach_m == pytest.approx(reach, abs=5e-3)
        assert pose.height_m == pytest.approx(0.75 * reach, abs=5e-3)
        assert all(-1.88 <= pose.joints[f"{leg}_knee"] <= -0.52 for leg in ("fl", "fr", "rl", "rr"))

    def test_the_shortest_leg_says_how_low_and_the_longest_how_far(self, tmp_path: Path) -> None:
        """Hind shanks of 0.25 m; the same search finds the same pose to the last bit."""
        text = walker().replace("0 0 -0.2", "0 0 -0.25")
        for leg in ("fl", "fr"):
            at = text.index(f'name="{leg}_foot"')
            text = text[:at] + text[at:].replace("-0.25", "-0.2", 1)
        text = text.replace('pos="0 0 -0.25"><joint', 'pos="0 0 -0.2"><joint')
        pose = self.pose(tmp_path, text)
        short, long = (np.sqrt(0.04 + b * b + 0.4 * b * np.cos(0.52)) + 0.02 for b in (0.2, 0.25))
        assert pose.reach_m == pytest.approx(long, abs=5e-3)
        assert pose.height_m == pytest.approx(0.75 * short, abs=5e-3)
        assert self.pose(tmp_path, text) == pose

    def test_the_height_of_a_given_pose_is_that_of_its_lowest_foot(self, tmp_path: Path) -> None:
        machine, _ = build_machine(read(tmp_path, walker()), "m")
        given = dict.fromkeys((each.name for each in machine.hinges), 0.0)
        given |= {name: -1.0 for name in given if "knee" in name} | {"rr_knee": -0.5}
        assert standing_pose(machine, given).height_m == pytest.approx(
            0.2 + 0.2 * np.cos(0.5) + 0.02, abs=1e-6
        )

    def test_legs_may_have_unlike_numbers_of_joints(self, tmp_path: Path) -> None:
        text = walker().replace(
            '<joint name="rl_hip"', '<joint name="rl_yaw" axis="0 0 1" range="-1 1"/><joint name="rl_hip"'
        )
        pose = self.pose(tmp_path, text)
        assert pose.height_m == pytest.approx(0.75 * (0.4 * np.cos(0.26) + 0.02), abs=5e-3)

    def test_two_legs_stand_nearly_straight(self, tmp_path: Path) -> None:
        text = walker(legs=(("l", 0.0, 0.1), ("r", 0.0, -0.1)), knee="0.4 2")
        pose = self.pose(tmp_path, text)
        reach = 0.4 * np.cos(0.26) + 0.02
        assert pose.height_m == pytest.approx(0.95 * reach, abs=5e-3)
        assert pose.knees_forward_m > 0.01

    def test_knees_that_may_bend_either_way_bend_backward_on_four_legs(self, tmp_path: Path) -> None:
        pose = self.pose(tmp_path, walker(knee="-2 2"))
        assert pose.knees_forward_m < -0.05
        assert all(pose.joints[f"{leg}_knee"] < -0.5 for leg in ("fl", "fr", "rl", "rr"))

    def test_legs_that_are_alike_stand_alike(self, tmp_path: Path) -> None:
        pose = self.pose(tmp_path, walker(knee="-2 2"))
        for leg, mirrored in (("fr", -1.0), ("rl", 1.0), ("rr", -1.0)):
            expected = [mirrored * pose.joints["fl_roll"], pose.joints["fl_hip"], pose.joints["fl_knee"]]
            assert [pose.joints[f"{leg}_{part}"] for part in ("roll", "hip", "knee")] == pytest.approx(
                expected, abs=1e-12
            )

    def test_feet_move_under_a_load_that_is_ahead_and_to_one_side(self, tmp_path: Path) -> None:
        load = '<geom type="box" size="0.02 0.02 0.02" pos="0.25 0.12 0.1" mass="2"/>'
        machine, _ = build_machine(read(tmp_path, walker(more=load)), "m")
        pose = standing_pose(machine)
        model = mujoco.MjModel.from_xml_string(model_xml(machine))
        data = mujoco.MjData(model)
        for name, angle in pose.joints.items():
            data.joint(name).qpos = angle
        mujoco.mj_forward(model, data)
        feet = np.mean([data.geom(leg.geoms[0]).xpos for leg in machine.legs], axis=0)
        np.testing.assert_allclose(data.subtree_com[1][:2], feet[:2], atol=4e-3)
        assert data.subtree_com[1][0] - data.xpos[1][0] > 0.05
        assert data.subtree_com[1][1] - data.xpos[1][1] > 0.02

    def test_joints_of_no_leg_are_as_near_to_zero_as_they_go(self, tmp_path: Path) -> None:
        """A waist that both legs of a biped hang on."""
        pose = self.pose(tmp_path, ODD)
        assert pose.joints["waist"] == pytest.approx(0.2)

    def test_a_given_pose_is_kept_within_94_hundredths_of_each_range(self, tmp_path: Path) -> None:
        machine, _ = build_machine(read(tmp_path, walker()), "m")
        given = {each.name: 0.3 for each in machine.hinges} | {"rl_knee": -3.0, "fr_knee": -1.0}
        pose = standing_pose(machine, given)
        assert (pose.joints["fl_hip"], pose.joints["fr_knee"]) == pytest.approx((0.3, -1.0))
        assert pose.joints["rl_knee"] == pytest.approx(-1.2 - 0.94 * 0.8)
        assert pose.joints["fl_knee"] == pytest.approx(-1.2 + 0.94 * 0.8)

    def searches(self, tmp_path: Path, text: str) -> tuple[mujoco.MjModel, mujoco.MjData, list[LegSearch]]:
        machine, _ = build_machine(read(tmp_path, text), "m")
        model = mujoco.MjModel.from_xml_string(model_xml(machine))
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        return model, data, [LegSearch(model, data, leg) for leg in machine.legs]

    @pytest.mark.parametrize(("other", "across"), [(1, -1.0), (2, 1.0), (3, -1.0)])
    def test_a_leg_stands_like_another_or_like_its_mirror_image(
        self, tmp_path: Path, other: int, across: float
    ) -> None:
        """Also where hinges count the other way, and from another angle."""
        text = walker()
        for name in ("fr", "rl"):
            text = text.replace(f'"{name}_hip" axis="0 1 0"', f'"{name}_hip" axis="0 -1 0" ref="0.4"')
        model, data, legs = self.searches(tmp_path, text)
        angles = legs[0].zero + np.array([0.3, -0.5, -0.9])
        data.qpos[legs[0].at], data.qpos[legs[other].at] = angles, legs[other].like(legs[0], angles)
        mujoco.mj_kinematics(model, data)
        first, second = (leg.foot(data) - [*leg.hip[:2], 0.0] for leg in (legs[0], legs[other]))
        np.testing.assert_allclose(second, first * [1.0, across, 1.0], atol=1e-6)

    def test_a_foot_belongs_below_where_it_is_at_zero_nearer_for_a_leg_that_is_spread(
        self, tmp_path: Path
    ) -> None:
        """0.4 m long: one that reaches 0.1 m down of it is spread, and stands at 0.7 of its 0.3 m."""

        def spread(name: str, y: float, down: float) -> str:
            aside = np.sign(y) * np.sqrt(0.16 - down**2)
            return f"""<body name="{name}" pos="0.1 {y} 0">
              <joint name="{name}_hip" axis="0 0 1" range="-1 1"/>
              <geom name="{name}_foot" size="0.02" pos="0 {aside} {-down}" mass="0.1"/></body>"""

        _, _, legs = self.searches(tmp_path, on_base(spread("a", 0.1, 0.1), spread("b", -0.1, 0.2)))
        aside = np.sqrt(0.16 - 0.1**2)
        np.testing.assert_allclose(legs[0].natural_place(), [0.1, 0.1 + 0.7 * aside], atol=1e-5)
        np.testing.assert_allclose(legs[1].natural_place(), [0.1, -0.1 - np.sqrt(0.12)], atol=1e-5)

    def test_what_stands_on_three_balls_off_a_line_is_a_sole(self, tmp_path: Path) -> None:
        def feet(*places: tuple[float, float]) -> str:
            return "".join(f'<geom size="0.01" pos="{x} {y} -0.3" mass="0.01"/>' for x, y in places)

        limbs = [
            hanging("a_foot", 0.3, 0.01, feet((0.1, 0.0), (-0.1, 0.03), (-0.1, -0.03))),
            hanging("b_foot", 0.0, 0.01, feet((0.1, 0.0), (0.0, 0.0), (-0.1, 0.0))),
            hanging("c_foot", -0.3, 0.01, feet((0.1, 0.0), (-0.1, 0.03))),
        ]
        _, _, legs = self.searches(tmp_path, on_base(*limbs))
        assert [leg.sole for leg in legs] == [True, False, False]

    def test_a_sole_is_set_down_level_and_pointing_ahead(self, tmp_path: Path) -> None:
        """The biped's, of six joints to a leg."""
        machine, _ = build_machine(read(tmp_path, BIPED_MJCF), "m")
        pose = standing_pose(machine)
        model = mujoco.MjModel.from_xml_string(model_xml(machine))
        data = mujoco.MjData(model)
        for name, angle in pose.joints.items():
            data.joint(name).qpos = angle
        mujoco.mj_kinematics(model, data)
        for leg in machine.legs:
            axes = data.body(machine.links[leg.link].name).xmat.reshape(3, 3)
            np.testing.assert_allclose(axes, np.eye(3), atol=0.03)


class TestStatics:
    """10 kg on two legs that swing sideways about hips 0.1 m off the middle; feet 0.05 m farther out."""

    def found(self, centre: tuple[float, float, float], weight: float = 0.0) -> Statics:
        legs = "".join(
            f"""<body name="{name}" pos="0 {0.1 * side} 0"><joint name="{name}" axis="1 0 0"/>
              <geom name="{name}0" size="0.01" pos="0.1 {0.05 * side} -0.49" mass="{1e-6 + weight}"/>
              <geom name="{name}1" size="0.01" pos="-0.1 {0.05 * side} -0.49" mass="{1e-6 + weight}"/>
            </body>"""
            for name, side in (("left", 1.0), ("right", -1.0))
        )
        text = f"""<mujoco><worldbody><body pos="0 0 9"><joint name="extra" type="free"/>
          <geom size="0.1" pos="{centre[0]} {centre[1]} {centre[2]}" mass="10"/>{legs}</body>
          </worldbody></mujoco>"""
        model = mujoco.MjModel.from_xml_string(text)
        own = tuple(Leg(name, (name,), 1, (f"{name}0", f"{name}1")) for name in ("left", "right"))
        return statics(model, ("left", "right"), own, model.qpos0)

    @pytest.mark.parametrize(("aside", "left"), [(0.0, 0.5), (0.03, 0.6), (-0.06, 0.3)])
    def test_each_leg_carries_as_much_as_balances_the_weight_about_both_axes(
        self, aside: float, left: float
    ) -> None:
        """Of feet at 0.15 and -0.15 m the left one bears (0.15 + y) / 0.3 of 98.1 N, 0.05 m from its hip."""
        torque = self.found((0.02, aside, 0.1)).torque_nm
        assert torque == pytest.approx([-0.05 * 98.1 * left, 0.05 * 98.1 * (1 - left)], abs=1e-3)

    def test_the_legs_own_weight_hangs_on_their_hips(self) -> None:
        """1 kg in each foot lies on the ground: the hips carry what they did without it."""
        torque = self.found((0.0, 0.0, 0.1), weight=0.5).torque_nm
        assert torque == pytest.approx([-0.05 * 49.05, 0.05 * 49.05], abs=1e-3)


class TestCreate:
    def request(self, tmp_path: Path, folder: str = "made", **wishes: Any) -> ImportRequest:
        (tmp_path / "m.urdf").write_text(quadruped())
        return ImportRequest(tmp_path / "m.urdf", tmp_path / folder, RANGES, **wishes)

    def test_the_folder_may_lie_in_others_that_are_not_there_and_names_the_robot(
        self, tmp_path: Path
    ) -> None:
        made = import_robot(self.request(tmp_path, "new/deep/my dog-2_x"))
        assert made.folder == tmp_path / "new/deep/my dog-2_x"
        assert load_robot(made.folder).name == "my_dog-2_x"
        assert [path.name for path in made.folder.parent.iterdir()] == ["my dog-2_x"]

    @pytest.mark.parametrize("wish", ["peak_torque_nm", "speed_rad_s", "armature"])
    def test_a_wish_for_a_joint_that_there_is_not_is_refused(self, tmp_path: Path, wish: str) -> None:
        with pytest.raises(UserError, match="no joint has 'wrist' in its name"):
            import_robot(self.request(tmp_path, **{wish: {"wrist": 3.0}}))
        assert not (tmp_path / "made").exists()

    def test_a_link_to_nowhere_is_a_folder_that_exists(self, tmp_path: Path) -> None:
        (tmp_path / "made").symlink_to(tmp_path / "nowhere")
        with pytest.raises(UserError, match="exists already"):
            import_robot(self.request(tmp_path))

    def test_what_cannot_be_loaded_is_not_left_behind(self, tmp_path: Path) -> None:
        """Joints of so much damping that the plant's steps cannot follow it."""
        request = self.request(tmp_path)
        request.source.write_text(quadruped().replace('damping="0.1', 'damping="900.1'))
        with pytest.raises(UserError, match="too much for its inertia"):
            import_robot(request)
        assert [path.name for path in tmp_path.iterdir()] == ["m.urdf"]

    def test_torques_that_no_frame_carries_are_told_of(self, tmp_path: Path) -> None:
        made = import_robot(self.request(tmp_path, peak_torque_nm={"FL_knee": 900.0}))
        assert "no protocol here carries what FL_knee can do: the widest was taken" in made.guesses
        plain = import_robot(self.request(tmp_path, "plain"))
        assert not any("no protocol here" in guess or "pairs of links" in guess for guess in plain.guesses)
        assert plain.guesses[0] == "base: 'trunk', its x axis pointing forward, z up"
        assert any(guess.startswith("gains: a natural frequency") for guess in plain.guesses)
