"""Bootstrap over blocks of residuals: estimates how much a fit depends on the choice of blocks."""

from collections.abc import Callable

import numpy as np

CHORDS = 1  # further steps of each refit with residuals at its own parameters
SMALL = 1e-9  # added to the normal equations


def block_weights(groups: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Weights of blocks in `count` resamples, (count, W), of mean 1.

    The weights are drawn from an exponential distribution (Bayesian bootstrap: Rubin, Annals of Statistics 9
    (1981), 130-134): no resample lacks a block altogether, which may be the only one that tells a parameter.
    Where blocks are of several groups, the groups are weighted likewise, so that what differs from one
    group to the next counts.

    Args:
        groups: number of each block's group, for instance of its recording, (W,).
        count: of resamples.
        rng: of the draws.
    """
    names, member = np.unique(groups, return_inverse=True)
    weights = rng.exponential(size=(count, len(groups)))
    if len(names) > 2:
        weights = weights * rng.exponential(size=(count, len(names)))[:, member]
    result: np.ndarray = weights / weights.mean(axis=1, keepdims=True)
    return result


def refitted(
    x: np.ndarray,
    residual: np.ndarray,
    slope: np.ndarray,
    weights: np.ndarray,
    residual_at: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """Solutions of weighted least squares, (B, p), by chord steps starting at x.

    Args:
        x: solution with equal weights, (p,).
        residual: at x, (W, m).
        slope: of the residuals at x, (W, m, p).
        weights: of the blocks in each resample, (B, W).
        residual_at: residuals, (K, W, m), of candidates (p, K).
    """
    grams = np.einsum("bw,wij->bij", weights, np.einsum("wmi,wmj->wij", slope, slope))
    grams = grams + SMALL * np.eye(len(x))

    def step(found: np.ndarray) -> np.ndarray:
        """Gauss-Newton steps, (B, p), of residuals (B, W, m)."""
        gradients = np.einsum("bw,bwi->bi", weights, np.einsum("wmi,bwm->bwi", slope, found))
        moves: np.ndarray = np.linalg.solve(grams, gradients[..., None])[..., 0]
        return -moves

    solutions = x + step(residual[None])
    for _ in range(CHORDS):
        solutions = solutions + step(residual_at(solutions.T))
    return solutions
