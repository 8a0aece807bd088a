"""Simulated robots without a controller."""

from typing import Any

from footfall.deploy.wiring import wiring_of
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.robots.description import Robot


def body_of(robot: Robot, **difference: Any) -> SimulatedRobot:
    wiring = wiring_of(robot)
    return SimulatedRobot(robot, wiring, SimulatedWires(wiring.buses), PlantConfig(held=False, **difference))
