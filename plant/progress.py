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
        self._chord_start: list[float] = []  # x and y, m; empty before the first sample
        self._last: list[float] = []
        self._velocity_sum = np.zeros(3)

    def add(self, positions: np.ndarray, velocities: np.ndarray) -> None:
        """T samples: the base's positions m, world frame, (T, 3), and velocities m/s, body frame, (T, 3)."""
        first = -self._count % self._stride
        for corner in positions[first :: self._stride, :2].tolist():
            self._length_m += math.dist(self._chord_start or corner, corner)
            self._chord_start = corner
        self._last = positions[-1, :2].tolist() if len(positions) else self._last
        self._count += len(positions)
        self._velocity_sum += np.add.reduce(velocities)

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
    progress.add(position, np.zeros_like(position))
    return progress.distance_m
