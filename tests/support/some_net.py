"""A robot with an actuator net of arbitrary weights."""

import shutil
from itertools import pairwise
from pathlib import Path

import numpy as np

from footfall.robots.actuator_net import INPUTS, ActuatorNet, save_net
from footfall.robots.description import Robot, load_robot

HIDDEN, MEMORY_S = 4, np.array([0.005, 0.02])


def some_net(joints: int, seed: int = 0) -> ActuatorNet:
    """Networks whose torque is some tenths of a N m for a robot in motion."""
    rng = np.random.default_rng(seed)
    sizes = (INPUTS * (1 + len(MEMORY_S)), HIDDEN, HIDDEN, 1)
    layers = tuple(rng.normal(0.0, 1.0 / np.sqrt(a), (joints, a, b)) for a, b in pairwise(sizes))
    scale = rng.uniform(0.5, 1.5, (joints, INPUTS)) * [0.05, 2.0, 5.0]
    linear = rng.normal(0.0, 0.1, (joints, sizes[0], 1))
    return ActuatorNet(layers, linear, MEMORY_S, scale, rng.uniform(0.5, 1.0, joints))


def with_net(robot: Robot, folder: Path, seed: int = 0) -> Robot:
    """A copy of the robot's folder with such a net."""
    shutil.copytree(robot.folder, folder)
    save_net(folder / "net.npz", some_net(len(robot.joint_names), seed), robot.joint_names)
    with (folder / "robot.yaml").open("a") as file:
        file.write("\nactuator_net: net.npz\n")
    return load_robot(folder)
