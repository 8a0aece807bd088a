"""Errors of height scans act as declared, in NumPy and in JAX."""

import jax.numpy as jnp
import numpy as np
import pytest

from footfall.common.config import structure
from footfall.common.errors import UserError
from footfall.domain_rand.height_scan import NUMBERS, HeightScanErrors, draw_errors, with_errors

POINTS = 400
HEIGHTS = np.linspace(-0.5, 0.0, POINTS)


def delivered(errors: HeightScanErrors, u: np.ndarray, taken_s: float = 0.0, seed: int = 0) -> np.ndarray:
    noise = np.random.default_rng(seed).random((2, POINTS))
    return with_errors(HEIGHTS, errors, draw_errors(errors, u), np.float64(taken_s), noise)


def episodes(seed: int, count: int = 200) -> np.ndarray:
    return np.random.default_rng(seed).random((count, NUMBERS))


def test_without_errors_a_scan_is_exact() -> None:
    for u in episodes(0, 5):
        np.testing.assert_array_equal(delivered(HeightScanErrors(), u, 100.0), HEIGHTS)


def test_noise_differs_from_point_to_point_and_from_scan_to_scan() -> None:
    errors = HeightScanErrors(noise_m=0.05)
    one, other = (delivered(errors, np.full(NUMBERS, 0.5), seed=seed) - HEIGHTS for seed in (1, 2))
    assert 0.04 < np.abs(one).max() <= 0.05
    assert abs(one.mean()) < 0.01
    assert abs(np.corrcoef(one, other)[0, 1]) < 0.2


def test_an_offset_moves_all_heights_and_drifts() -> None:
    errors = HeightScanErrors(offset_m=0.04, drift_m_s=0.01)
    offsets = []
    for u in episodes(1):
        at_first, later = delivered(errors, u) - HEIGHTS, delivered(errors, u, 5.0) - HEIGHTS
        assert np.ptp(at_first) < 1e-12
        assert np.abs(later - at_first).max() <= 0.05 + 1e-12
        offsets.append(at_first[0])
    assert -0.04 <= min(offsets) < -0.035
    assert 0.035 < max(offsets) <= 0.04


def test_up_to_the_declared_share_of_points_is_missing() -> None:
    shares = [np.isnan(delivered(HeightScanErrors(missing_share=0.4), u)).mean() for u in episodes(2)]
    assert min(shares) < 0.05
    assert 0.35 < max(shares) < 0.5
    assert np.mean(shares) == pytest.approx(0.2, abs=0.03)


def test_scans_stop_in_the_declared_share_of_episodes() -> None:
    errors = HeightScanErrors(lost_share=0.5, lost_before_s=4.0)
    scans = np.array([[delivered(errors, u, at_s) for at_s in (0.0, 2.0, 4.0)] for u in episodes(3)])
    first, later, last = np.isnan(scans).all(axis=2).mean(axis=0)
    assert (first, last) == pytest.approx((0.25, 0.5), abs=0.08)
    assert first < later < last


def test_a_scan_without_information_does_not_correlate_with_the_ground() -> None:
    found = delivered(HeightScanErrors(useless_share=1.0, useless_m=0.2), np.full(NUMBERS, 0.5))
    assert abs(np.corrcoef(found, HEIGHTS)[0, 1]) < 0.15
    assert np.abs(found - HEIGHTS.mean()).max() <= 0.2


def test_numpy_and_jax_agree() -> None:
    errors = HeightScanErrors(0.02, 0.03, 0.01, 0.05, (0.01, 0.1), 0.3, 0.3, 5.0, 0.2)
    noise = np.random.default_rng(0).random((2, POINTS))
    for u in episodes(4, 30):
        in_numpy, in_jax = draw_errors(errors, u), draw_errors(errors, jnp.asarray(u))
        for one, other in zip(in_numpy, in_jax, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-5, atol=1e-8)
        seen = with_errors(HEIGHTS, errors, in_numpy, np.float64(3.0), noise)
        seen_in_jax = with_errors(jnp.asarray(HEIGHTS), errors, in_jax, jnp.float32(3.0), jnp.asarray(noise))
        np.testing.assert_allclose(seen, seen_in_jax, atol=1e-6)


@pytest.mark.parametrize("wrong", [{"noise_m": -0.1}, {"lag_s": [0.2, 0.1]}, {"lost_share": 1.5}, {"fog": 1}])
def test_invalid_errors_are_refused_by_name(wrong: dict[str, object]) -> None:
    with pytest.raises(UserError, match=next(iter(wrong))):
        structure(wrong, HeightScanErrors, "x.yaml")
