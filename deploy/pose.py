"""Check of measured joint positions against the joints' ranges."""

import math

import numpy as np

from footfall.robots.description import Robot


def beyond(position: np.ndarray, lower: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """Distance of joints beyond their range, rad, (n,); 0 within."""
    return np.maximum(np.maximum(lower - position, position - upper), 0.0)


def impossible_pose(robot: Robot, labels: list[str], position: np.ndarray, margin_rad: float) -> str:
    """First joint with an impossible position, and the likely reason; empty if all are possible.

    An encoder at the rotor is absolute within one turn of the rotor, one at the output within one turn of the
    joint: a motor that miscounted while it was disabled is wrong by a multiple of either.

    Args:
        robot: robot with these joints.
        labels: names of the joints' motors, for the message.
        position: measured positions, rad, (n,).
        margin_rad: permitted distance beyond a joint's range.
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
        f"{labels[joint]} reads {position[joint]:.2f} rad, outside its range of"
        f" {robot.lower_rad[joint]:.2f} to {robot.upper_rad[joint]:.2f} rad{reason}"
    )


def _turns(position: float, lower: float, upper: float, turn: float, part: str) -> str:
    """Number of turns that would explain a position outside a range; empty if no integer does."""
    if not math.isfinite(position):
        return ""
    count = (
        math.ceil((position - upper) / turn) if position > upper else math.floor((position - lower) / turn)
    )
    if not lower <= position - count * turn <= upper:
        return ""
    return f": off by {count:+d} turn{'s' * (abs(count) != 1)} {part} ({count * turn:+.2f} rad)?"
