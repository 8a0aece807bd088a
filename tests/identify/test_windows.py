"""Recordings, their noise, and the windows they are cut into."""

from dataclasses import replace

import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.identify.recording import Recording
from footfall.identify.windows import cut


def recording(time_s: np.ndarray) -> Recording:
    """A recording of one joint that stands still."""
    rows = len(time_s)
    readings = time_s[:, None], np.zeros((rows, 1)), np.full((rows, 1), np.nan)
    return Recording("a file", time_s, np.zeros((rows, 5, 1)), *readings, 0.0, np.array([0.0, 0.0, -1.0]))


def test_a_window_holds_its_own_readings_at_any_rate() -> None:
    rng = np.random.default_rng(0)
    time_s = np.cumsum(rng.uniform(0.002, 0.009, 1000))
    windows = cut(recording(time_s), np.array([0]), 1.0, 0.002)
    assert windows.width >= 4
    assert ((windows.time_s > 0.0) & (windows.time_s < 1.0)).all()


def test_a_window_with_a_gap_is_left_out_and_windows_without_readings_are_refused() -> None:
    time_s = np.arange(0.0, 5.2, 0.005)
    whole = cut(recording(time_s), np.array([0]), 1.0, 0.002).width
    windows = cut(recording(time_s[(time_s < 2.3) | (time_s > 2.8)]), np.array([0]), 1.0, 0.002)
    assert windows.width == whole - 1
    assert (np.diff(windows.time_s[:, :, 0]) < 0.02).all()
    with pytest.raises(UserError):
        cut(recording(np.arange(0.0, 400.0, 1.0)), np.array([0]), 0.5, 0.002)


@pytest.mark.parametrize("moving", [1.0, 0.1, 0.0])
def test_a_joint_that_rests_has_the_rounding_error_of_its_readings(moving: float) -> None:
    """With too small a noise every model would be a misfit."""
    time_s, step_rad = np.arange(0.0, 7.0, 0.002), 4e-4
    angles = np.sin(5.0 * np.stack([time_s, np.minimum(time_s, 7.0 * moving)], axis=1))
    noise = replace(recording(time_s), position=step_rad * np.round(angles / step_rad)).position_noise_rad
    np.testing.assert_allclose(noise, step_rad / np.sqrt(12.0), rtol=0.1)
