"""Limits on position targets, shared by the joint layer and the training environment."""

from typing import Any

Array = Any


def limit_target(
    goal: Array, previous: Array, lower: Array, upper: Array, rate_rad_s: float, dt_s: float
) -> Array:
    """The target after one joint tick: inside the soft limits, moving no faster than the rate limit.

    Args:
        goal: wanted position target, rad, shape (..., n).
        previous: target of the tick before, rad.
        lower, upper: soft limits, rad.
        rate_rad_s: fastest change of a target.
        dt_s: time since the tick before.
    """
    xp = goal.__array_namespace__()
    step = rate_rad_s * dt_s
    inside = xp.minimum(xp.maximum(goal, lower), upper)
    return previous + xp.minimum(xp.maximum(inside - previous, -step), step)
