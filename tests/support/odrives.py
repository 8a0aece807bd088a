"""Robots with ODrives, which report voltage and current."""

from dataclasses import replace

from footfall.robots.battery import Battery
from footfall.robots.description import Robot


def with_odrives(robot: Robot, *motors: str, first_id: int = 1, battery: Battery | None = None) -> Robot:
    """The robot with ODrives for some of its kinds of motors, and a declared battery."""
    description = robot.description
    entries = {n: replace(m, protocol="ODrive") if n in motors else m for n, m in description.motors.items()}
    joints = tuple(replace(joint, id=joint.id + first_id - 1) for joint in description.joints)
    return replace(robot, description=replace(description, motors=entries, joints=joints, battery=battery))
