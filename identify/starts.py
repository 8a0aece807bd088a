"""Windows' starts as nuisance parameters: a step towards their optimum, and residuals without their effect.

Variable projection (Golub and Pereyra 1973).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from footfall.identify.differences import EPS


class Elimination(NamedTuple):
    """Takes out of residuals what a change of the starts explains, to first order."""

    pseudo_inverse: np.ndarray  # (W, m, s) transposed, regularised pseudo-inverse of the slopes
    slope: np.ndarray  # (W, m, s) derivatives of residuals by the starts, in their standard deviations

    def apply(self, residuals: np.ndarray) -> np.ndarray:
        """Residuals, (K, W, m), without the part that a change of the starts explains."""
        projection = np.einsum("wmi,kwm->kwi", self.slope, residuals)
        result: np.ndarray = residuals - np.einsum("wmi,kwi->kwm", self.pseudo_inverse, projection)
        return result


class StartStep(NamedTuple):
    """One Gauss-Newton step of the starts of W windows."""

    residuals: np.ndarray  # (W, m) before the step
    move: np.ndarray  # (W, s)
    elimination: Elimination


def start_step(
    residuals_at: Callable[[np.ndarray], np.ndarray],
    start: np.ndarray,
    prior: np.ndarray,
    sigma: np.ndarray,
    weight: np.ndarray,
) -> StartStep:
    """Step of each window's start towards the optimum of its residuals and its prior.

    Args:
        residuals_at: residuals, (C, W, m), for C choices of the starts, (C, W, s).
        start: current starts, (W, s).
        prior: estimated starts, (W, s).
        sigma: standard deviation of an estimated start, (s,).
        weight: weight of each window's prior, (W, 1).
    """
    size = start.shape[1]
    starts = np.repeat(start[None], size + 1, axis=0)
    for column in range(size):
        starts[column + 1, :, column] += EPS * sigma[column]
    residuals = residuals_at(starts)
    slope = np.moveaxis((residuals[1:] - residuals[0]) / EPS, 0, 2)
    normal = np.einsum("wmi,wmj->wij", slope, slope) + weight[..., None] * np.eye(size)
    gradient = np.einsum("wmi,wm->wi", slope, residuals[0]) + weight * ((start - prior) / sigma)
    move = -np.linalg.solve(normal, gradient[..., None])[..., 0] * sigma
    pseudo_inverse = np.einsum("wmi,wij->wmj", slope, np.linalg.inv(normal))
    return StartStep(residuals[0], move, Elimination(pseudo_inverse, slope))
