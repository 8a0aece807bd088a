"""Robust statistics: the standard deviation from the median, and the weight of outliers."""

from collections.abc import Sequence

import numpy as np

NORMAL_MEDIAN = 0.6745  # median of the absolute values of a normal distribution, in standard deviations
OUTLIER_SIGMAS = 3.0  # larger residuals get less weight


def robust_sigma(values: np.ndarray, axis: Sequence[int] | None = None) -> np.ndarray:
    """Standard deviation of normally distributed values, which outliers hardly change."""
    result: np.ndarray = np.median(np.abs(values), axis=axis) / NORMAL_MEDIAN
    return result


def outlier_factor(residuals: np.ndarray, sigma: float) -> np.ndarray:
    """Factors of at least 1 by which residuals are divided (Cauchy loss); `sigma` counts as 1 if smaller."""
    result: np.ndarray = np.sqrt(1.0 + (residuals / (OUTLIER_SIGMAS * max(sigma, 1.0))) ** 2)
    return result
