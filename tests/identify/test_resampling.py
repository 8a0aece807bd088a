"""Refits of resampled windows."""

import numpy as np

from footfall.identify.resampling import refitted


def test_refits_evaluate_within_the_bounds_only_and_keep_their_spread() -> None:
    """A delay near 0 has resamples whose best delay is negative, which no simulation supports."""
    best, weights = np.array([-0.3, 0.5]), np.array([[1.0, 0.0], [0.0, 1.0]])

    def residual_at(x: np.ndarray) -> np.ndarray:
        assert (x >= 0.0).all()
        return (x[0][:, None] - best)[..., None]

    x = np.array([0.1])
    found = refitted(
        x, residual_at(x[:, None])[0], np.ones((2, 1, 1)), weights, residual_at, (np.zeros(1), np.ones(1))
    )
    np.testing.assert_allclose(found[:, 0], best, atol=1e-3)
