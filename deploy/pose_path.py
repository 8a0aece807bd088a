"""A path through joint poses: a smooth curve from each to the next, at rest at each."""

import math
from collections.abc import Sequence

import numpy as np


class PosePath:
    """Joint positions as a function of time."""

    def __init__(
        self, poses: Sequence[np.ndarray], rates_rad_s: Sequence[float], least_s: float = 0.0
    ) -> None:
        """The joint with the longest travel sets the time from one pose to the next.

        Args:
            poses: (n,) rad each, the first one where the path begins.
            rates_rad_s: fastest that any joint moves from each pose to the next, rad/s.
            least_s: shortest time from one pose to the next, s.
        """
        self._poses = np.array(poses)
        ways = np.abs(np.diff(self._poses, axis=0)).max(axis=1, initial=0.0)
        # Half a turn of a cosine is pi / 2 times as fast in its middle as on average.
        self._lasts_s = np.maximum(0.5 * math.pi * ways / np.array(rates_rad_s), least_s).tolist()
        self.duration_s = float(sum(self._lasts_s))

    def at(self, time_s: float) -> np.ndarray:
        """Joint positions (n,), rad; before the beginning the first pose, after the end the last one."""
        for leg, lasts_s in enumerate(self._lasts_s):
            if time_s < lasts_s:
                start, goal = self._poses[leg : leg + 2]
                share = 0.5 - 0.5 * math.cos(math.pi * max(time_s, 0.0) / lasts_s)
                return start + share * (goal - start)
            time_s -= lasts_s
        return self._poses[-1]
