"""Distance and mean velocity of a walk."""

import numpy as np
import pytest

from footfall.plant.progress import Progress, path_length


def test_progress_counts_the_chord_since_the_last_corner() -> None:
    """At 4 samples a second a chord has two samples, so a corner within a chord is cut off."""
    progress = Progress(4.0)
    found = []
    for point in ((0, 0), (3, 0), (3, 4), (3, 8), (3, 8), (0, 8)):
        progress.add(np.array([*point, 99.0 * point[0]]), np.zeros(3))
        found.append(progress.distance_m)
    assert found == pytest.approx([0.0, 3.0, 5.0, 9.0, 9.0, 12.0])


def test_a_path_is_measured_in_chords_of_half_a_second() -> None:
    """The path is two metres along a line with a sway of 5 cm at 2 Hz, then one metre to the left."""
    time_s = np.arange(0.0, 2.0, 0.01)
    sway = 0.05 * np.sin(4 * np.pi * time_s)
    along = np.column_stack([time_s, sway, 0.3 + 0 * time_s])
    assert path_length(along, 100.0) == pytest.approx(1.99, abs=0.01)
    corner = np.array([[0.0, 0.0, 0.0]] * 50 + [[2.0, 0.0, 0.0]] * 50 + [[2.0, 1.0, 9.0]] * 50)
    assert path_length(corner, 100.0) == pytest.approx(3.0)


def test_the_mean_velocity_is_over_all_samples() -> None:
    progress = Progress(10.0)
    assert np.isnan(progress.mean_velocity).all()
    assert progress.distance_m == 0.0
    for step in range(4):
        progress.add(np.array([0.1 * step, 0.0, 0.0]), np.array([float(step), 1.0, -step]))
    np.testing.assert_allclose(progress.mean_velocity, [1.5, 1.0, -1.5])
    assert progress.distance_m == pytest.approx(0.3)
