"""Inputs of a controller for a rotated robot."""

from typing import Any

import numpy as np
from moments import policy_input
from scipy.spatial.transform import Rotation

from footfall import PolicyInput, load_robot

ROBOT = load_robot("go1")


def observed(turn: Rotation, time_s: float = 9.0, base_height: float = 0.26, **more: Any) -> PolicyInput:
    """Inputs for a robot with this orientation whose joints differ from the default pose and each other."""
    position, velocity = ROBOT.default_pose + 0.01 * np.arange(12), 0.1 * np.arange(12)
    return policy_input(
        ROBOT, time_s, base_height=base_height, turn=turn, joint=position, velocity=velocity, **more
    )
