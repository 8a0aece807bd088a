"""Fits over windows of recordings, on an oscillator that is solved in closed form."""

import numpy as np
import pytest

from footfall.identify.shooting import FitParameter, Shooting

TRUTH = np.array([7.0, 0.8])  # undamped frequency, rad/s; decay rate of the amplitude, 1/s
PARAMETERS = (
    FitParameter("speed", "rad/s", 6.0, 1.0, 20.0, 0.5),
    FitParameter("decay", "1/s", 0.2, 0.0, 5.0, 0.2),
)
TIMES = np.linspace(0.0, 0.5, 30)


def oscillate(parameters: np.ndarray, start: np.ndarray) -> np.ndarray:
    """x'' = -w² x - 2 d x'."""
    w, d = parameters[:, :, None, None]
    position, velocity = start[:, :, :1], start[:, :, 1:]
    damped = np.sqrt(w * w - d * d)
    sine = (velocity + d * position) / damped * np.sin(damped * TIMES)
    motion: np.ndarray = (np.exp(-d * TIMES) * (position * np.cos(damped * TIMES) + sine))[..., None]
    return motion


def recorded() -> Shooting:
    """Windows of two recordings, the second three times as long; the estimated starts have errors."""
    rng = np.random.default_rng(0)
    start = rng.normal(size=(12, 2)) * (0.3, 2.0)
    measured = oscillate(TRUTH[:, None], start[None])[0]
    measured = measured + 0.001 * rng.normal(size=measured.shape)
    return Shooting(
        oscillate,
        PARAMETERS,
        measured,
        np.array([0.001]),
        start + rng.normal(size=start.shape) * (0.003, 0.3),
        np.array([0.003, 0.3]),
        (np.arange(12) >= 3).astype(int),
    )


def test_a_fit_finds_the_truth_although_starts_are_wrong_and_readings_jump() -> None:
    windows = recorded()
    windows.measured[::3, 7] += 0.3
    windows.measured[1, 3] = np.nan
    fitted = windows.fit()
    assert fitted == pytest.approx(TRUTH, rel=0.01)
    assert np.nanmedian(np.abs(windows.errors(fitted))) < 0.002
    assert np.nanmedian(np.abs(windows.errors(windows.guess))) > 0.01


def test_recordings_have_equal_weight_and_held_out_windows_none() -> None:
    windows = recorded()
    weight = windows.of([0, 1, 1]).weight
    assert weight[windows.recording == 1].sum() == pytest.approx(2 * weight[windows.recording == 0].sum())
    held_out = np.arange(12) % 2 == 0
    windows.measured[held_out] = 0.0  # wrong values that must not be used
    assert windows.of([0, 1], excluded=held_out).fit() == pytest.approx(TRUTH, rel=0.02)


def test_a_fixed_parameter_stays() -> None:
    fixed = recorded().with_fixed("speed", 7.0)
    assert [each.name for each in fixed.parameters] == ["decay"]
    assert fixed.fit() == pytest.approx(TRUTH[1:], rel=0.05)
    residual, slope = fixed.slopes(fixed.fit())
    assert slope.shape == (12, residual.shape[1], 1)
