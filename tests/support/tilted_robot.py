"""What a controller is handed while the robot is turned."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from footfall.policies.policy import PolicyInput, Sensed
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
UP = np.array([0.0, 0.0, 1.0])


def observed(turn: Rotation, gyro: Any = (0, 0, 0), time_s: float = 9.0, **more: Any) -> PolicyInput:
    """A robot turned so, with joints that all differ from the default pose and from one another."""
    position = ROBOT.default_pose + 0.01 * np.arange(12)
    sensed = Sensed(
        np.array(gyro, dtype=float),
        9.81 * turn.inv().apply(UP),
        turn.as_quat(scalar_first=True),
        position,
        0.1 * np.arange(12),
        np.zeros(12),
    )
    values = {"command": np.zeros(3), "base_velocity": np.zeros(3), "base_height": 0.26, **more}
    return PolicyInput(time_s, sensed, **values)
