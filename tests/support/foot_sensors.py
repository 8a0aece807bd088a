"""Robots with force sensors at the feet."""

from dataclasses import replace

from changed_robots import described

from footfall.robots.description import Robot


def equipped(robot: Robot) -> Robot:
    """The robot with a force sensor at each foot, on the bus of the foot's leg."""
    bus_of = {joint.name: joint.bus for joint in robot.description.joints}
    feet = (replace(foot, force_bus=bus_of[foot.joints[0]]) for foot in robot.description.feet)
    return described(robot, feet=tuple(feet))
