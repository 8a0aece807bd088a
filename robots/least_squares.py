"""Inverse kinematics of serial chains by damped least squares within joint limits, several at once.

Levenberg-Marquardt with the damping of Sugihara 2011 ("Solvability-unconcerned inverse kinematics by the
Levenberg-Marquardt method"): it grows with the squared error, so that a position out of reach ends in the
pose nearest to it, and vanishes at the solution, where steps become Newton steps. Each solve begins at the
default pose, so that its result, and the choice among several solutions, depends on the position alone.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

_ITERATIONS = 40  # largest number of iterations
_CLOSE_M = 1e-10  # largest error of a solution
_WORTHWHILE = 1.0 - 1e-4  # an iteration must reduce the squared error to this share
_DAMPING = 1e-9  # m^2, damping that remains at the solution
_LEVEL_WEIGHT_M = 0.1  # metres; weight of one radian of orientation error


class Chains(NamedTuple):
    """The limbs' tips in a pose, base frame; limbs with fewer hinges than m have zero columns."""

    tip: np.ndarray  # (limbs, 3) m
    jacobian: np.ndarray  # (limbs, 3, m) m/rad
    axes: np.ndarray  # (limbs, 3, m) directions of the hinges
    rotation: np.ndarray  # (limbs, 3, 3) rotation of the last link


class LeastSquares:
    """Solves for the angles of limbs that have no closed form.

    Args:
        forward: forward kinematics of joint angles (limbs, m).
        lower, upper: (limbs, m) rad, joint limits.
        default: (limbs, m) rad, start of each solve.
        level: (limbs,) whether the last link keeps its orientation of the default pose: soles of limbs with
            enough hinges.
    """

    def __init__(
        self,
        forward: Callable[[np.ndarray], Chains],
        lower: np.ndarray,
        upper: np.ndarray,
        default: np.ndarray,
        level: np.ndarray,
    ) -> None:
        self._forward, self._lower, self._upper, self._default = forward, lower, upper, default
        start = forward(default)
        self._tip, self._rotation = start.tip.copy(), start.rotation.copy()
        self._weight = _LEVEL_WEIGHT_M * level[:, None]

    def solve(self, tips: np.ndarray, limbs: list[int]) -> np.ndarray:
        """Joint angles (k, m), rad, for tip positions (k, 3), m, of k limbs, or as near as possible.

        Results are finite and within the limits; NaN for NaN. If a sole cannot be level at its position, the
        position takes precedence over the orientation.
        """
        target = self._tip.copy()
        finite = np.isfinite(tips).all(axis=1)
        target[limbs] = np.where(finite[:, None], tips, target[limbs])
        angles, remaining_m = self._descend(target, self._default, self._weight)
        if self._weight.any() and remaining_m.max() > _CLOSE_M:
            nearest, _ = self._descend(target, angles, 0.0 * self._weight)
            angles = np.where((remaining_m > _CLOSE_M)[:, None], nearest, angles)
        result = angles[limbs]
        result[~finite] = np.nan
        return result

    def _descend(
        self, target: np.ndarray, start: np.ndarray, weight: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The best angles found from a start, (limbs, m), and their remaining error, (limbs,) m."""
        angles = best = start
        smallest = np.full(len(start), np.inf)
        for _ in range(_ITERATIONS):
            error, jacobian = self._error(angles, target, weight)
            square = (error * error).sum(axis=1)
            better = square < _WORTHWHILE * smallest
            best, smallest = np.where(better[:, None], angles, best), np.where(better, square, smallest)
            if not better.any() or smallest.max() < _CLOSE_M**2:
                break
            angles = self._next_angles(angles, error, jacobian, square)
        return best, np.sqrt(smallest)

    def _error(
        self, angles: np.ndarray, target: np.ndarray, weight: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Error, (limbs, 3 or 6) m, and its Jacobian: position, then orientation of soles."""
        ends = self._forward(angles)
        position_error = target - ends.tip
        if not weight.any():
            return position_error, ends.jacobian
        # The remaining rotation; a small one equals its skew part.
        rotation = self._rotation @ ends.rotation.transpose(0, 2, 1)
        rotation_error = 0.5 * (rotation[:, [2, 0, 1], [1, 2, 0]] - rotation[:, [1, 2, 0], [2, 0, 1]])
        error = np.concatenate([position_error, weight * rotation_error], axis=1)
        return error, np.concatenate([ends.jacobian, weight[:, :, None] * ends.axes], axis=1)

    def _next_angles(
        self, angles: np.ndarray, error: np.ndarray, jacobian: np.ndarray, square: np.ndarray
    ) -> np.ndarray:
        """The next angles. Joints that would move beyond their limit are fixed; the others are solved for."""
        damping = (0.5 * square + _DAMPING)[:, None, None] * np.eye(error.shape[1])
        step = _damped_step(jacobian, error, damping)
        at_limit = ((angles <= self._lower) & (step < 0.0)) | ((angles >= self._upper) & (step > 0.0))
        if at_limit.any():
            step = _damped_step(np.where(at_limit[:, None, :], 0.0, jacobian), error, damping)
        return np.minimum(np.maximum(angles + step, self._lower), self._upper)


def _damped_step(jacobian: np.ndarray, error: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """J' (J J' + damping)^-1 error, (limbs, m)."""
    transposed = jacobian.transpose(0, 2, 1)
    return (transposed @ np.linalg.solve(jacobian @ transposed + damping, error[:, :, None]))[:, :, 0]
