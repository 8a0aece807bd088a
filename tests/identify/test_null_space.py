"""Directions of parameters that the data do not determine, and refits of resampled windows."""

import numpy as np
import pytest

from footfall.identify.null_space import null_directions, profile
from footfall.identify.resampling import refitted

NAMES = ["armature", "delay", "friction"]


def test_parameters_with_the_same_effect_are_named_together() -> None:
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(2, 200))
    slope = np.stack([one, -2.0 * one, other], axis=1)
    (found,) = null_directions(slope + 1e-6 * rng.normal(size=slope.shape), NAMES)
    assert found.parts == pytest.approx({"armature": 1.0, "delay": 0.5}, abs=1e-3)
    assert found.deviation > 1e3
    assert "delay" in found.text


def test_noise_and_too_few_rows_leave_directions_undetermined() -> None:
    slope = np.diag([10.0, 10.0, 1.0])
    assert null_directions(slope, NAMES, noise=0.1) == ()
    assert [each.parts for each in null_directions(slope, NAMES, noise=1.0)] == [{"friction": 1.0}]
    assert len(null_directions(slope[:1], NAMES)) == 2


def test_a_profile_shows_how_other_parameters_compensate_for_one() -> None:
    """The misfit is that of a + d = 3 with d held, so all values of d fit equally well.

    A second equation 0.1 d = 0.1 bounds d.
    """

    def fit_at(delay: float) -> tuple[float, np.ndarray]:
        return 1.0 + (delay - 1.0) ** 2, np.array([3.0 - delay])

    found = profile(fit_at, [0.0, 0.5, 1.0, 2.0])
    assert found.range_within(1.3) == (0.5, 1.0)
    np.testing.assert_allclose(found.numbers[:, 0], [3.0, 2.5, 2.0, 1.0])


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
