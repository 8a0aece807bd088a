"""A policy's input at a single time: a robot at rest in its default pose, with given changes."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.policies.policy import PolicyInput, Sensed
from footfall.robots.description import Robot

UP = np.array([0.0, 0.0, 1.0])
LEVEL = Rotation.identity()


def about(axis: str, angle: float) -> np.ndarray:
    """Rotation (3, 3) about one of the axes x, y and z."""
    return np.array(Rotation.from_euler(axis, angle).as_matrix())


def readings(
    robot: Robot,
    turn: Rotation = LEVEL,
    gyro: Any = (0.0, 0.0, 0.0),
    joint: np.ndarray | None = None,
    velocity: np.ndarray | float = 0.0,
    torque: np.ndarray | float = 0.0,
) -> Sensed:
    """Readings of a robot whose base is turned from the world's axes; it accelerates by gravity alone."""
    zeros = np.zeros(len(robot.joint_names))
    return Sensed(
        np.array(gyro, dtype=float),
        9.81 * turn.inv().apply(UP),
        turn.as_quat(scalar_first=True),
        robot.default_pose if joint is None else joint,
        zeros + velocity,
        zeros + torque,
    )


def under_load(robot: Robot, force: np.ndarray, acceleration: np.ndarray = 9.81 * UP) -> Sensed:
    """Readings at rest in the default pose, with forces (legs, 3), N, on the feet; the limbs have weight."""
    legs, pose = robot.legs, robot.default_pose
    torque = legs.holding_torque(pose, acceleration) + legs.torque(legs.pose(pose).jacobian, force)
    sensed = readings(robot, torque=legs.scatter(torque, np.zeros_like(pose)))
    return sensed._replace(acceleration=acceleration)


def whole_body_arguments(policy: Any, monkeypatch: pytest.MonkeyPatch, inputs: PolicyInput) -> tuple:
    """Arguments of whole-body control: dynamics, position, velocity, desired accelerations, largest force."""
    result: list[tuple] = []
    monkeypatch.setattr(policy.control, "command", lambda *arguments: result.append(arguments))
    policy.act(inputs)
    return result[0]


def policy_input(
    robot: Robot,
    time_s: float = 0.0,
    command: Any = (0.0, 0.0, 0.0),
    base_velocity: Any = (0.0, 0.0, 0.0),
    base_height: float = 0.3,
    **sensed: Any,
) -> PolicyInput:
    """Inputs with these readings (see `readings`); base velocity in the body's axes, m/s, height in m."""
    arrays = (np.array(values, dtype=float) for values in (command, base_velocity))
    return PolicyInput(time_s, readings(robot, **sensed), *arrays, base_height)
