"""Limits on position targets, shared by the joint layer and the training environment."""

from typing import Any

Array = Any


def soft_limits(lower: Array, upper: Array, factor: float) -> tuple[Array, Array]:
    """Lowest and highest position target, rad: a share of each joint's range, about its middle."""
    middle, half = (lower + upper) / 2, (upper - lower) / 2
    return middle - factor * half, middle + factor * half


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
    xp, step = goal.__array_namespace__(), rate_rad_s * dt_s
    change = xp.minimum(xp.maximum(goal, lower), upper) - previous
    return previous + xp.minimum(xp.maximum(change, -step), step)
