"""Simulated robots without a controller, and poses to put them in."""

from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from footfall.deploy.wiring import wiring_of
from footfall.plant.robot import PlantConfig, SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.robots.description import Robot


def body_of(robot: Robot, **difference: Any) -> SimulatedRobot:
    wiring = wiring_of(robot)
    return SimulatedRobot(robot, wiring, SimulatedWires(wiring.buses), PlantConfig(held=False, **difference))


def throw(body: SimulatedRobot) -> None:
    """Put the robot high above the ground, tilted about all axes, with every joint and the gate in motion."""
    data, model = body.data, body.model
    rng = np.random.default_rng(8)
    turned = Rotation.from_euler("xyz", [0.4, -0.3, 2.0]).as_quat(scalar_first=True)
    data.qpos[1:8] = [1.0, -2.0, 6.0, *turned]
    data.qpos[8:] += rng.uniform(-0.2, 0.2, model.nq - 8)
    data.qvel[:] = rng.uniform(-2.0, 2.0, model.nv)
    mujoco.mj_forward(model, data)


def lift(body: SimulatedRobot, pose: np.ndarray) -> None:
    """Put the robot a metre above the ground, in a pose (n,) of go1's joints."""
    body.data.qpos[2], body.data.qpos[7:] = 1.0, pose
    mujoco.mj_forward(body.model, body.data)
