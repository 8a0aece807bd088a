"""Confidence intervals of rates, of means, and of the push that half of all robots survive.

SciPy has the first two, but its 143 MB are too much for a robot's small computer. Tests compare with SciPy.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

Interval = tuple[float, float]

CONFIDENCE = 0.95
RESAMPLES = 1000
NORMAL_QUANTILE = 1.959963984540054  # of the standard normal distribution at 97.5 %


def wilson_interval(successes: int, trials: int) -> Interval:
    """95 % Wilson score interval of a rate; (0, 1) without trials."""
    if not 0 <= successes <= trials:
        raise ValueError(f"{successes} successes in {trials} trials")
    if trials == 0:
        return 0.0, 1.0
    z2 = NORMAL_QUANTILE**2
    rate = successes / trials
    middle = (rate + z2 / (2 * trials)) / (1 + z2 / trials)
    spread = rate * (1 - rate) / trials + z2 / (4 * trials**2)
    half = NORMAL_QUANTILE / (1 + z2 / trials) * math.sqrt(spread)
    low = 0.0 if successes == 0 else middle - half
    high = 1.0 if successes == trials else middle + half
    return low, high


def weighted_mean(values: ArrayLike, weights: ArrayLike) -> float:
    """Mean of the finite values (N,), NaN if they carry no weight."""
    value, weight = _finite(values, weights)
    return float(weight @ value / weight.sum()) if weight.sum() > 0 else math.nan


def bootstrap_mean_interval(values: ArrayLike, weights: ArrayLike, seed: int = 0) -> Interval:
    """95 % percentile bootstrap interval of `weighted_mean`, episodes (N,) resampled with replacement."""
    value, weight = _finite(values, weights)
    keep = weight > 0
    value, weight = value[keep], weight[keep]
    if not len(value):
        return math.nan, math.nan
    counts = _resampled_counts(len(value), seed)
    means = counts @ (weight * value) / (counts @ weight)
    low, high = np.quantile(means, _tails())
    return float(low), float(high)


class Survival(NamedTuple):
    """Chance to survive a push: 1 / (1 + exp((x - dv50) / width))."""

    dv50: float  # m/s; infinite if most survive the strongest push tried, 0 if few survive the weakest
    width: float  # m/s
    interval: Interval  # 95 %, of dv50

    def chance(self, delta_v: np.ndarray) -> np.ndarray:
        """Chance to survive pushes of these sizes, m/s."""
        return 1.0 / (1.0 + np.exp(np.clip((delta_v - self.dv50) / self.width, -60.0, 60.0)))


def fit_survival(delta_v: ArrayLike, survived: ArrayLike, seed: int = 0) -> Survival:
    """Logistic fit of survival against the size of the push, with a bootstrap interval of its 50 % point.

    A weak ridge on the steepness keeps the fit finite if a push size separates survivors from fallen robots.

    Args:
        delta_v: sizes (N,), m/s.
        survived: whether the robot stayed up, (N,).
        seed: seed of the bootstrap.
    """
    x, y = np.asarray(delta_v, dtype=float), np.asarray(survived, dtype=float)
    if x.shape != y.shape or not len(x):
        raise ValueError("needs as many outcomes as pushes, and at least one")
    middle, width = _fit(x, y, np.ones((1, len(x))))
    resampled, _ = _fit(x, y, _resampled_counts(len(x), seed))
    low, high = np.sort(resampled)[[int(tail * (len(resampled) - 1)) for tail in _tails()]]
    return Survival(float(middle[0]), float(width[0]), (float(low), float(high)))


RIDGE = 0.05  # weight of the squared steepness, in units of the range of pushes tried
NEWTON_STEPS = 30


def _fit(x: np.ndarray, y: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """50 % point and width (B,) of logistic fits to the same data (N,) under B weightings (B, N)."""
    low, high = x.min(), x.max()
    span = max(high - low, 1e-9)
    design = np.stack([np.ones_like(x), (x - low) / span])  # (2, N)
    coefficients = np.zeros((len(weights), 2))
    penalty = np.diag([1e-6, RIDGE])
    for _ in range(NEWTON_STEPS):
        chance = 1.0 / (1.0 + np.exp(-np.clip(coefficients @ design, -30.0, 30.0)))
        gradient = (weights * (y - chance)) @ design.T - coefficients @ penalty
        curvature = np.einsum("in,bn,jn->bij", design, weights * chance * (1 - chance), design) + penalty
        step = np.linalg.solve(curvature, gradient[..., None])[..., 0]
        coefficients += np.clip(step, -3.0, 3.0)
    offset, slope = coefficients.T
    share = weights @ y / weights.sum(axis=1)
    falling = slope < -1e-9
    steepness = np.where(falling, -slope, 1e-9)
    middle = np.where(falling, low + span * offset / steepness, np.where(share > 0.5, np.inf, 0.0))
    middle = np.where((share == 1.0) | (middle > high), np.inf, middle)
    middle = np.where((share == 0.0) | (middle < 0.0), 0.0, middle)
    return middle, span / steepness


def _resampled_counts(size: int, seed: int) -> np.ndarray:
    """How often each of `size` items is drawn in each resample, (RESAMPLES, size)."""
    rng = np.random.default_rng(seed)
    return rng.multinomial(size, np.full(size, 1.0 / size), size=RESAMPLES).astype(float)


def _finite(values: ArrayLike, weights: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
    value, weight = np.asarray(values, dtype=float), np.asarray(weights, dtype=float)
    keep = np.isfinite(value) & np.isfinite(weight)
    return value[keep], weight[keep]


def _tails() -> tuple[float, float]:
    return (1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2
