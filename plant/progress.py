"""Distance and mean velocity of a walk, updated sample by sample in constant memory."""

import math

import numpy as np

PATH_INTERVAL_S = 0.5  # duration of the chords of a path, so that sway within a stride does not count


class Progress:
    """Distance and mean velocity of samples at a fixed rate."""

    def __init__(self, rate_hz: float) -> None:
        self._stride = max(1, round(PATH_INTERVAL_S * rate_hz))
        self._count = 0
        self._length_m = 0.0
        self._chord_start = self._last = (0.0, 0.0)
        self._velocity_sum = np.zeros(3)

    def add(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """One sample: the base's position m, world frame, (3,), and its velocity m/s, body frame, (3,)."""
        self._last = float(position[0]), float(position[1])
        if self._count % self._stride == 0:
            self._length_m += 0.0 if self._count == 0 else math.dist(self._chord_start, self._last)
            self._chord_start = self._last
        self._count += 1
        self._velocity_sum += velocity

    @property
    def distance_m(self) -> float:
        """Length of the horizontal path so far."""
        return self._length_m + math.dist(self._chord_start, self._last)

    @property
    def mean_velocity(self) -> np.ndarray:
        """Mean of the velocities, m/s, (3,); NaN without samples."""
        return self._velocity_sum / self._count if self._count else np.full(3, np.nan)


def path_length(position: np.ndarray, rate_hz: float) -> float:
    """Length of a horizontal path, m, as `Progress` measures it, from positions (T, 3)."""
    progress = Progress(rate_hz)
    for row in position:
        progress.add(row, np.zeros(3))
    return progress.distance_m
