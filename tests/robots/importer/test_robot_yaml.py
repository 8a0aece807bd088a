"""The robot.yaml of an imported robot."""

from dataclasses import replace
from typing import NamedTuple

import pytest
import yaml
from rods import hinge, rod_machine

from footfall.robots.importer.machine import Leg
from footfall.robots.importer.motors import Drive, JointMotor
from footfall.robots.importer.pose import Pose
from footfall.robots.importer.robot_yaml import choose_protocols, robot_yaml


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
    machine = rod_machine([hinge("a")])
    drive = Drive({"a": JointMotor(20.0, 30.0, 0.2)}, 8.0, 0.3, True, ())
    return choose_protocols(machine, drive, known)


@pytest.mark.parametrize(
    "lacking",
    [
        FrameLimits(19.9),
        FrameLimits(20.0, velocity=29.0),
        FrameLimits(20.0, kp=25.0),
        FrameLimits(20.0, kd=1.0),
    ],
)
def test_a_joint_gets_the_weakest_sufficient_motor(lacking: FrameLimits) -> None:
    chosen = protocols(a=FrameLimits(90.0), b=lacking, c=FrameLimits(25.0, kp=25.3, kd=1.01))
    assert chosen == ({"a": "c"}, [])
    assert protocols(a=lacking, b=FrameLimits(18.0)) == ({"a": "a"}, ["a"])


def yaml_lines() -> list[str]:
    names = [f"j{k}" for k in range(9)]
    own = tuple(Leg(f"leg {k}", tuple(names[1 + 4 * k : 5 + 4 * k]), 1, (f"g{k}",)) for k in range(2))
    machine = rod_machine([hinge(name) for name in names], own)
    motors = {name: JointMotor(20.0 + (name == "j2"), 30.0 + k, 0.25) for k, name in enumerate(names)}
    pose = Pose(dict.fromkeys(names, 0.12346), 0.34567, 0.0, 0.5)
    return robot_yaml(
        machine, pose, Drive(motors, 8.0, 0.3, True, ()), dict.fromkeys(names, "AK"), []
    ).splitlines()


def test_each_leg_has_buses_of_its_own_of_three_motors_each() -> None:
    joints = [line for line in yaml_lines() if "default_rad" in line]
    addresses = [line.partition("bus: ")[2].rstrip("}") for line in joints]
    assert addresses == [
        "can0, id: 1",
        *("can1, id: 1", "can1, id: 2", "can1, id: 3", "can2, id: 1"),
        *("can3, id: 1", "can3, id: 2", "can3, id: 3", "can4, id: 1"),
    ]
    assert "default_rad: 0.1235," in joints[0]


def test_height_speed_and_motors_are_written() -> None:
    lines = yaml_lines()
    assert any(line.startswith("standing_height_m: 0.3457 ") for line in lines)
    assert any(line.startswith("target_rate_rad_s: 76 ") for line in lines)  # twice the fastest
    assert lines.count("    friction_speed_rad_s: 0.25") == 9
    assert sum(line.startswith("    stall_torque_nm: 20") for line in lines) == 8


def test_names_that_yaml_would_read_as_other_types_are_quoted() -> None:
    machine = replace(rod_machine([hinge("no"), hinge("1e3"), hinge("Off")]), name="y")
    motors = dict.fromkeys(("no", "1e3", "Off"), JointMotor(20.0, 30.0, 0.2))
    pose = Pose(dict.fromkeys(motors, 0.0), 0.3, 0.0, 0.5)
    text = robot_yaml(
        machine, pose, Drive(motors, 8.0, 0.3, True, ()), dict.fromkeys(motors, "AK"), ["guess"]
    )
    content = yaml.safe_load(text)
    assert content["name"] == "y"
    assert [joint["name"] for joint in content["joints"]] == ["no", "1e3", "Off"]
    assert text.startswith("# guess\n")
