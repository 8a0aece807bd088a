"""Recording of joint targets and readings at each tick."""

import numpy as np

from footfall.common.rotations import rotation_matrix
from footfall.deploy.loop import ControlLoop


class Recording:
    """Recorded samples of a run."""

    def __init__(self) -> None:
        self._time_s: list[float] = []
        self._joints: list[np.ndarray] = []  # (5, n) each
        self._up: list[np.ndarray] = []

    def add(self, loop: ControlLoop) -> None:
        """Add one sample of a loop."""
        sensed = loop.sensed
        joints = [
            loop.target, sensed.joint_position, sensed.joint_velocity, sensed.joint_torque, loop.temperature_c
        ]  # fmt: skip
        self._time_s.append(loop.walking_s)
        self._joints.append(np.array(joints))
        self._up.append(rotation_matrix(sensed.quaternion)[2])

    def between(self, begin_s: float, end_s: float) -> "Samples":
        """Samples in a time range."""
        times = np.array(self._time_s)
        first, last = np.searchsorted(times, [begin_s, end_s])
        return Samples(times[first:last], np.array(self._joints[first:last]), np.array(self._up[first:last]))


class Samples:
    """T samples of n joints, in joint order."""

    def __init__(self, time_s: np.ndarray, joints: np.ndarray, up: np.ndarray) -> None:
        """Times (T,), five readings of each joint (T, 5, n) and up in the base frame (T, 3)."""
        self.time_s = time_s
        self.target, self.position = joints[:, 0], joints[:, 1]  # rad
        self.velocity, self.torque = joints[:, 2], joints[:, 3]  # rad/s, N m
        self.temperature_c = joints[:, 4]  # NaN if not reported
        self.roll = np.arctan2(up[:, 1], up[:, 2])  # rad, positive with the right side down
        self.pitch = np.arctan2(-up[:, 0], up[:, 2])  # rad, positive with the front down
