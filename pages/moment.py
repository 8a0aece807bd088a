"""A moment of a robot's motion, as the page draws it."""

from typing import NamedTuple

import numpy as np

from footfall.robots.readings import Sensed


class Moment(NamedTuple):
    """State of a robot: the simulation's ground truth, or the estimate from its sensors."""

    time_s: float
    position: np.ndarray  # (3,) m, of the base; the ground is at z = 0
    quaternion: np.ndarray  # (4,) w x y z, body to world
    velocity: np.ndarray  # (3,) m/s, of the base, body frame
    command: np.ndarray  # (3,) forward m/s, leftward m/s, yaw rad/s
    sensed: Sensed
    contact: np.ndarray  # (feet,) probability that each foot stands
    footholds: np.ndarray | None = None  # (feet, 3) m, as of `PlansFootholds`; None without a plan

    @property
    def command_velocity(self) -> np.ndarray:
        """The velocity in the command's axes: forward m/s, leftward m/s, yaw rad/s, (3,)."""
        return np.array([*self.velocity[:2], self.sensed.gyro[2]])
