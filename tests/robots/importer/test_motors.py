"""Motors, gains, protocols and robot.yaml of an imported robot."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import pytest
import yaml
from foreign_robots import make, quadruped

from footfall.common.errors import UserError
from footfall.robots.importer.actuators import actuators
from footfall.robots.importer.machine import Hinge, Leg, Link, Machine
from footfall.robots.importer.motors import Drive, JointMotor, choose_drive, peak_torques
from footfall.robots.importer.pose import Pose
from footfall.robots.importer.robot_yaml import choose_protocols, robot_yaml
from footfall.robots.importer.source import Source
from footfall.robots.importer.statics import Statics

CALM = Statics(np.zeros(3), np.zeros((0, 0)), np.zeros((3, 0)))  # no weight, nothing to tip


def rod_machine(hinges: Sequence[Hinge], legs: tuple[Leg, ...] = ()) -> Machine:
    """A base of 5 kg and a link of 3 kg with some hinges."""
    place = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    link = Link("link", 0, *place, 3.0, np.zeros(3), np.eye(3), tuple(hinges), ())
    return Machine("m", (replace(link, name="base", parent=-1, mass=5.0, hinges=()), link), legs, np.zeros(3))


def hinge(name: str, span: float = 2.0) -> Hinge:
    axis, lower, upper = np.array([0.0, 1.0, 0.0]), -0.25 * span, 0.75 * span
    return Hinge(name, axis, np.zeros(3), lower, upper, 0.0, 0.01, 0.0, 0.0)


HINGES = hinge("a", 0.5), hinge("b"), hinge("c")


def source_of(peak: dict[str, float], speed: dict[str, float] | None = None) -> Source:
    return Source(Path("m.urdf"), mujoco.MjModel.from_xml_string("<mujoco/>"), False, {}, peak, speed or {})


def drive_of(
    *torque: float,
    hinges: Sequence[Hinge] = HINGES,
    statics: Statics = CALM,
    given: dict[str, float] | None = None,
    speed: dict[str, float] | None = None,
) -> Drive:
    peak = {each.name: value for each, value in zip(hinges, torque, strict=True)}
    return choose_drive(rod_machine(hinges), source_of(peak, speed), peak, given or {}, statics)


def test_the_middle_joint_has_peak_torque_at_0_75_rad() -> None:
    """20 N m over 0.01 kg m^2 and 0.75 rad give 51.6 rad/s or 8.2 Hz, which is rounded down to 8 Hz."""
    drive = drive_of(10.0, 20.0, 90.0)
    assert (drive.natural_frequency_hz, drive.stands) == (8.0, True)


def test_motors_that_are_too_weak_to_stand_are_refused_the_worst_first() -> None:
    heavy = CALM._replace(torque_nm=np.array([11.0, -60.0, 89.0]))
    with pytest.raises(UserError, match=r"b 60 .*20 .*a 11 .*10 .*--peak-torque"):
        drive_of(10.0, 20.0, 90.0, statics=heavy)


def test_an_action_moves_no_joint_by_more_than_nine_tenths_of_its_range() -> None:
    """kp = 0.01 (2 pi 8)^2 = 25.27 N m/rad; 0.5 rad then need 0.1263 of 90 N m."""
    assert drive_of(10.0, 20.0, 90.0, hinges=(hinge("a"), hinge("b"), hinge("c", 0.5))).torque_share == 0.126
    assert drive_of(10.0, 20.0, 20.0).torque_share == 0.3


def test_stiffness_is_twice_the_least_that_keeps_it_from_tipping_or_the_usual_with_a_note() -> None:
    """Gravity takes 10 N m/rad from the second joint, which gets 20 N m/rad at 7.12 Hz."""
    for tipping, torque, result, note in (
        (-10.0, (1.0, 1.0, 1.0), (7.5, True), "7.5 Hz"),
        (-1e9, (10.0, 20.0, 90.0), (8.0, False), "cannot stand by joint stiffness"),
    ):
        second = Statics(np.zeros(3), np.array([[tipping]]), np.array([[0.0], [1.0], [0.0]]))
        drive = drive_of(*torque, statics=second)
        assert (drive.natural_frequency_hz, drive.stands) == result
        assert any(note in guess for guess in drive.guesses)


def test_speeds_are_the_users_or_else_the_files_if_plausible() -> None:
    drive = drive_of(20.0, 20.0, 20.0, given={"a": 12.0}, speed={"a": 3.0, "b": 59.0, "c": 61.0})
    assert [drive.motors[name].no_load_speed_rad_s for name in "abc"] == [12.0, 59.0, 30.0]
    assert [guess for guess in drive.guesses if "no-load speed of" in guess] == [
        "no-load speed of c: 30 rad/s"
    ]
    assert [motor.no_load_speed_rad_s for motor in drive_of(20.0, 20.0, 20.0).motors.values()] == [30.0] * 3


def test_torque_is_at_most_3_weights() -> None:
    """8 kg * 9.81 m/s^2 * 0.4 m * 3 = 94.2 N m; the user's value is kept."""
    machine = rod_machine(HINGES)
    strong, excessive = (source_of({"a": 10.0, "b": torque, "c": 10.0}) for torque in (94.0, 95.0))
    bare = source_of({"a": 10.0, "c": 10.0})
    assert peak_torques(machine, strong, {}, 0.4)["b"] == 94.0
    for source, named in ((excessive, r"joint b .*95"), (bare, "joint b")):
        with pytest.raises(UserError, match=named):
            peak_torques(machine, source, {}, 0.4)
    assert peak_torques(machine, excessive, {"b": 200.0, "": 5.0}, 0.4) == {"a": 5.0, "b": 200.0, "c": 5.0}
    assert peak_torques(machine, bare, {"b": 200.0}, 0.4)["b"] == 200.0


def test_every_row_has_a_source_and_a_plausible_inertia() -> None:
    for name, row in actuators().items():
        assert row.source, name
        assert row.rated_torque_nm is None or row.rated_torque_nm < row.peak_torque_nm, name
        assert row.armature is None or 2e-5 < row.armature / row.peak_torque_nm < 2e-3, name
    assert actuators()["Unitree-Go1-hip"].armature == pytest.approx(0.00403, rel=1e-2)


def test_a_robot_of_known_motors(tmp_path: Path) -> None:
    chosen = {"": "Unitree-Go1-hip", "knee": "Unitree-Go1-knee"}
    robot, made = make(tmp_path, quadruped(), actuators=chosen)
    hip, knee = robot.joint_index("FL_hip"), robot.joint_index("FL_knee")
    assert robot.motor.peak_torque[[hip, knee]] == pytest.approx([23.7, 35.55])
    assert robot.motor.no_load_speed[[hip, knee]] == pytest.approx([30.1, 20.06])
    assert robot.armature[[hip, knee]] == pytest.approx([0.00403, 0.00906], rel=1e-2)
    assert robot.motor_figures("gear_ratio")[[hip, knee]] == pytest.approx([6.0, 9.0])
    assert any("Unitree-Go1-knee: Unitree, go1_description" in guess for guess in made.guesses)
    assert not any("reflected inertia" in guess for guess in made.guesses)
    assert "gear_ratio: 9" in (made.folder / "robot.yaml").read_text()


def test_unknown_actuators_are_refused(tmp_path: Path) -> None:
    for chosen, named in (
        ({"": "DM-J4310-2EC-24"}, r"mean DM-J4310-2EC-24V\?"),
        ({"elbow": "Unitree-4010"}, "'elbow'"),
    ):
        with pytest.raises(UserError, match=named):
            make(tmp_path, quadruped(), actuators=chosen)


def test_motors_beyond_their_rated_torque_are_reported_also_if_it_is_negative(tmp_path: Path) -> None:
    """The knee of one leg may turn about the opposite axis."""
    heavy = quadruped().replace('value="5.3"', 'value="9.3"')
    knee = re.search(r'<joint name="FL_knee".*?</joint>', heavy, re.DOTALL)
    assert knee is not None
    turned = re.sub(r'lower="-([\d.]+)" upper="-([\d.]+)"', r'lower="\2" upper="\1"', knee[0])
    turned = turned.replace('axis xyz="0 1 0"', 'axis xyz="0 -1 0"')
    for text, named in ((heavy, "of 3 N m"), (heavy.replace(knee[0], turned), "FL_knee")):
        _, made = make(tmp_path, text, actuators={"": "DM-J4310-2EC-48V"})
        (warning,) = (guess for guess in made.guesses if "beyond their rated torque" in guess)
        assert named in warning


class FrameLimits(NamedTuple):
    """Limits of an invented motor's frames."""

    torque: float
    velocity: float = 50.0
    kp: float = 500.0
    kd: float = 5.0


def protocols(**known: FrameLimits) -> tuple[dict[str, str], list[str]]:
    """The protocol chosen for a motor of 20 N m and 30 rad/s with gains of 8 Hz, critically damped.

    The gains are kp 25.3 and kd 1.005.
    """
    drive = Drive({"a": JointMotor(20.0, 30.0, 0.2)}, 8.0, 0.3, True, ())
    return choose_protocols(rod_machine([hinge("a")]), drive, known)


@pytest.mark.parametrize(
    "lacking",
    [
        FrameLimits(19.9),
        *(FrameLimits(20.0, **low) for low in ({"velocity": 29.0}, {"kp": 25.0}, {"kd": 1.0})),
    ],
)
def test_a_joint_gets_the_weakest_sufficient_motor(lacking: FrameLimits) -> None:
    chosen = protocols(a=FrameLimits(90.0), b=lacking, c=FrameLimits(25.0, kp=25.3, kd=1.01))
    assert chosen == ({"a": "c"}, [])
    assert protocols(a=lacking, b=FrameLimits(18.0)) == ({"a": "a"}, ["a"])


def written(machine: Machine, motors: dict[str, JointMotor], angle_rad: float, height_m: float) -> str:
    """The robot.yaml of a machine with one guess, in a pose in which all joints have the same angle."""
    pose = Pose(dict.fromkeys(motors, angle_rad), height_m, 0.0, 0.5)
    drive = Drive(motors, 8.0, 0.3, True, ())
    return robot_yaml(machine, pose, drive, dict.fromkeys(motors, "AK"), ["guess"])


def test_height_speed_and_motors_are_written_and_each_leg_has_buses_of_three_motors_each() -> None:
    names = [f"j{k}" for k in range(9)]
    own = tuple(Leg(f"leg {k}", tuple(names[1 + 4 * k : 5 + 4 * k]), 1, (f"g{k}",)) for k in range(2))
    machine = rod_machine([hinge(name) for name in names], own)
    motors = {name: JointMotor(20.0 + (name == "j2"), 30.0 + k, 0.25) for k, name in enumerate(names)}
    lines = written(machine, motors, 0.12346, 0.34567).splitlines()
    joints = [line for line in lines if "default_rad" in line]
    assert [line.partition("bus: ")[2].rstrip("}") for line in joints] == [
        "can0, id: 1",
        *("can1, id: 1", "can1, id: 2", "can1, id: 3", "can2, id: 1"),
        *("can3, id: 1", "can3, id: 2", "can3, id: 3", "can4, id: 1"),
    ]
    assert "default_rad: 0.1235," in joints[0]
    assert any(line.startswith("standing_height_m: 0.3457 ") for line in lines)
    assert any(line.startswith("target_rate_rad_s: 76 ") for line in lines)  # twice the fastest
    assert lines.count("    friction_speed_rad_s: 0.25") == 9
    assert sum(line.startswith("    stall_torque_nm: 20") for line in lines) == 8


def test_names_that_yaml_would_read_as_other_types_are_quoted() -> None:
    names = ["no", "1e3", "Off"]
    machine = replace(rod_machine([hinge(name) for name in names]), name="y")
    text = written(machine, dict.fromkeys(names, JointMotor(20.0, 30.0, 0.2)), 0.0, 0.3)
    content = yaml.safe_load(text)
    assert content["name"] == "y"
    assert [joint["name"] for joint in content["joints"]] == names
    assert text.startswith("# guess\n")
