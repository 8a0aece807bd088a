"""Limits on position targets, shared by the joint layer and the training environment."""

from typing import Any

from footfall.common.arrays import clamped

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
        goal: desired position target, rad, shape (..., n).
        previous: target of the previous tick, rad.
        lower, upper: soft limits, rad.
        rate_rad_s: fastest change of a target.
        dt_s: time since the previous tick.
    """
    return approach(clamped(goal, lower, upper), previous, rate_rad_s * dt_s)


def approach(goal: Array, previous: Array, step: float) -> Array:
    """From the previous target towards the goal, by one step at most, rad, (..., n)."""
    return previous + clamped(goal - previous, -step, step)
