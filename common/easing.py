"""Motions between two values that start and end at rest."""

import math


def smooth_rise(time_s: float, duration_s: float = 1.0) -> float:
    """Half a cosine: 0 before time 0, 1 after the duration, at rest at both ends."""
    return 0.5 - 0.5 * math.cos(math.pi * min(max(time_s, 0.0), duration_s) / duration_s)
