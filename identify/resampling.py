"""Bootstrap over blocks of residuals, for confidence intervals of a fit."""

from collections.abc import Callable

import numpy as np

CHORD_STEPS = 1  # further steps of each refit, with residuals at its own parameters
RIDGE = 1e-9  # added to the normal equations


def block_weights(groups: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Weights of blocks in `count` resamples, (count, W); their mean in a resample is 1.

    The weights are drawn from an exponential distribution (Bayesian bootstrap: Rubin, Annals of Statistics 9
    (1981), 130-134). No weight is 0, because a block may be the only one that identifies a parameter. With
    several groups, the groups get random weights, too, so that the intervals include differences between
    groups.

    Args:
        groups: index of each block's group, for instance its recording, (W,).
        count: number of resamples.
        rng: random generator.
    """
    distinct, group_index = np.unique(groups, return_inverse=True)
    weights = rng.exponential(size=(count, len(groups)))
    if len(distinct) > 2:
        weights = weights * rng.exponential(size=(count, len(distinct)))[:, group_index]
    result: np.ndarray = weights / weights.mean(axis=1, keepdims=True)
    return result


def refitted(
    x: np.ndarray,
    residual: np.ndarray,
    slope: np.ndarray,
    weights: np.ndarray,
    residual_at: Callable[[np.ndarray], np.ndarray],
    bounds: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Solutions of weighted least squares, (B, p), by chord steps starting at x.

    The last step may leave the bounds, so that they do not narrow the spread of the solutions.

    Args:
        x: solution with equal weights, (p,).
        residual: residuals at x, (W, m).
        slope: derivatives of the residuals at x, (W, m, p).
        weights: weights of the blocks in each resample, (B, W).
        residual_at: function of candidates, (p, K), that returns residuals, (K, W, m).
        bounds: lowest and highest candidates of `residual_at`, (p,) each.
    """
    grams = np.einsum("bw,wij->bij", weights, np.einsum("wmi,wmj->wij", slope, slope))
    grams = grams + RIDGE * np.eye(len(x))

    def step(residuals: np.ndarray) -> np.ndarray:
        """Gauss-Newton steps, (B, p), of residuals (B, W, m)."""
        gradients = np.einsum("bw,bwi->bi", weights, np.einsum("wmi,bwm->bwi", slope, residuals))
        moves: np.ndarray = np.linalg.solve(grams, gradients[..., None])[..., 0]
        return -moves

    solutions = x + step(residual[None])
    for _ in range(CHORD_STEPS):
        inside = solutions.clip(*bounds)
        solutions = inside + step(residual_at(inside.T))
    return solutions
