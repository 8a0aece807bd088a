"""A path through joint poses: a smooth curve between consecutive poses, at rest at each."""

import math
from collections.abc import Sequence

import numpy as np

from footfall.common.easing import smooth_rise


class PosePath:
    """Joint positions as a function of time."""

    def __init__(self, poses: Sequence[np.ndarray], rates_rad_s: Sequence[float], min_s: float = 0.0) -> None:
        """The joint with the longest travel determines the time between two poses.

        Args:
            poses: (n,) rad each; the first is the start of the path.
            rates_rad_s: largest joint speed between consecutive poses, rad/s.
            min_s: shortest time between two poses, s.
        """
        self._poses = np.array(poses)
        travel_rad = np.abs(np.diff(self._poses, axis=0)).max(axis=1, initial=0.0)
        # A cosine's peak speed is pi / 2 times its mean speed.
        self._durations_s = np.maximum(0.5 * math.pi * travel_rad / np.array(rates_rad_s), min_s).tolist()
        self.duration_s = float(sum(self._durations_s))

    def at(self, time_s: float) -> np.ndarray:
        """Joint positions (n,), rad; the first pose before the start, the last pose after the end."""
        for segment, duration_s in enumerate(self._durations_s):
            if time_s < duration_s:
                start, goal = self._poses[segment : segment + 2]
                share = smooth_rise(time_s, duration_s)
                return start + share * (goal - start)
            time_s -= duration_s
        return self._poses[-1]
