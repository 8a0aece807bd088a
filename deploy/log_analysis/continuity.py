"""Jumps in paths: steps between two samples that are much larger than the steps around them."""

from typing import NamedTuple

import numpy as np

AROUND = 5  # number of samples before and after a step for the comparison
TIMES_LARGER = 2.0  # a jump exceeds this many times the largest of these steps, plus a smallest excess
FOOT_JUMP_M = 0.005  # smallest excess of a foot's jump
JOINT_JUMP_RAD = 0.03  # smallest excess of a joint's jump


class Continuity(NamedTuple):
    """Largest step and jumps of several paths."""

    largest: float  # step between two samples
    largest_s: float  # time of this step
    jumps: list[tuple[float, int, float]]  # time s, index of the path, size


def continuity(time_s: np.ndarray, paths: np.ndarray, min_excess: float) -> Continuity:
    """Find jumps in paths.

    Args:
        time_s: (T,) times of the samples, s.
        paths: (T, paths, d) positions.
        min_excess: smallest excess of a jump over `TIMES_LARGER` times the largest step around it.
    """
    if len(time_s) < 2:
        return Continuity(0.0, 0.0, [])
    steps = np.nan_to_num(np.linalg.norm(np.diff(paths, axis=0), axis=2))  # (T - 1, paths)
    padded = np.pad(steps, ((AROUND, AROUND), (0, 0)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1, axis=0)
    around = np.delete(windows, AROUND, axis=2).max(axis=2)
    jumps = np.argwhere(steps > TIMES_LARGER * around + min_excess)
    row, path = np.unravel_index(int(steps.argmax()), steps.shape)
    return Continuity(
        float(steps[row, path]),
        float(time_s[row + 1]),
        [(float(time_s[row + 1]), int(path), float(steps[row, path])) for row, path in jumps],
    )
