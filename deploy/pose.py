"""Checks whether the joints can be where their encoders say."""

import math

import numpy as np

from footfall.robots.description import Robot


def beyond(position: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """How far joints are beyond their range, rad, (n,); 0 within."""
    return np.maximum(np.maximum(lower - position, position - upper), 0.0)


def impossible_pose(robot: Robot, places: list[str], position: np.ndarray, margin_rad: float) -> str:
    """The first joint that cannot be where it says, and the likely reason; empty if all can.

    An encoder at the rotor knows its angle within one turn of the rotor, one at the output within one turn of
    the joint: a motor that counted wrongly while it was off is wrong by a multiple of either.

    Args:
        robot: whose joints they are.
        places: of the joints, for the message.
        position: measured, rad, (n,).
        margin_rad: how far beyond its range a joint may be.
    """
    excess = beyond(position, robot.lower_rad, robot.upper_rad)
    wrong = np.flatnonzero(~(excess <= margin_rad))
    if not len(wrong):
        return ""
    joint = int(wrong[0])
    lower, upper = robot.lower_rad[joint] - margin_rad, robot.upper_rad[joint] + margin_rad
    sector = math.tau / float(robot.motor_figures("gear_ratio")[joint])
    reason = _turns(float(position[joint]), lower, upper, math.tau, "of the joint")
    reason = reason or _turns(float(position[joint]), lower, upper, sector, "of its rotor")
    return (
        f"{places[joint]} reads {position[joint]:.2f} rad, outside its range of"
        f" {robot.lower_rad[joint]:.2f} to {robot.upper_rad[joint]:.2f} rad{reason}"
    )


def _turns(position: float, lower: float, upper: float, turn: float, of: str) -> str:
    """How many turns would explain a position outside a range; empty if no whole number does."""
    if not math.isfinite(position):
        return ""
    count = (
        math.ceil((position - upper) / turn) if position > upper else math.floor((position - lower) / turn)
    )
    if not lower <= position - count * turn <= upper:
        return ""
    return f": off by {count:+d} turn{'s' * (abs(count) != 1)} {of} ({count * turn:+.2f} rad)?"
