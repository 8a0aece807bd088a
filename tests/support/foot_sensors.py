"""Robots with force sensors at the feet."""

from dataclasses import replace

from footfall.robots.description import Robot


def equipped(robot: Robot) -> Robot:
    """The robot with a force sensor at each foot, on the bus of the foot's leg."""
    description = robot.description
    bus_of = {joint.name: joint.bus for joint in description.joints}
    feet = tuple(replace(foot, force_bus=bus_of[foot.joints[0]]) for foot in description.feet)
    return replace(robot, description=replace(description, feet=feet))
