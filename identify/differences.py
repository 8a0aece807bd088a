"""Derivatives of residuals by finite differences."""

from collections.abc import Callable

import numpy as np

EPS = 1e-3  # step, in scales


def slopes_by_window(
    residuals: Callable[[np.ndarray], np.ndarray], x: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Residuals by window, (W, m), and their derivatives, (W, m, p), at x.

    Args:
        residuals: function of candidates, (p, K), that returns residuals, (K, W, m).
        x: scaled parameters, (p,).
        high: upper bounds of the parameters, (p,). A step that would cross a bound is taken downwards.
    """
    inward = np.where(x + EPS > high, -EPS, EPS)
    found = residuals(np.concatenate([x[:, None], x[:, None] + np.diag(inward)], axis=1))
    return found[0], np.moveaxis((found[1:] - found[0]) / inward[:, None, None], 0, 2)
