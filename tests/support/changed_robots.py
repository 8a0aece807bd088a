"""Robots whose description differs from that of their file."""

from dataclasses import replace
from typing import Any

from footfall.robots.description import Robot


def described(robot: Robot, **fields: Any) -> Robot:
    """The robot with other fields of its description."""
    return replace(robot, description=replace(robot.description, **fields))


def with_each_motor(robot: Robot, **fields: Any) -> Robot:
    """The robot with other fields of each kind of motor."""
    motors = robot.description.motors.items()
    return described(robot, motors={name: replace(motor, **fields) for name, motor in motors})


def with_foot_sensors(robot: Robot) -> Robot:
    """The robot with a force sensor at each foot, on the bus of the foot's leg."""
    bus_of = {joint.name: joint.bus for joint in robot.description.joints}
    feet = (replace(foot, force_bus=bus_of[foot.joints[0]]) for foot in robot.description.feet)
    return described(robot, feet=tuple(feet))
