"""Distance, mean velocity and energy of a walk."""

import tracemalloc

import numpy as np
import pytest

from footfall.plant.energy import EnergyMeter
from footfall.plant.progress import Progress, path_length
from footfall.robots.description import Robot


def test_progress_counts_the_chord_since_the_last_corner() -> None:
    """At 4 samples a second a chord has two samples, so a corner within a chord is cut off."""
    progress, found = Progress(4.0), []
    for point in ((0, 0), (3, 0), (3, 4), (3, 8), (3, 8), (0, 8)):
        progress.add(np.array([[*point, 99.0 * point[0]]]), np.zeros((1, 3)))
        found.append(progress.distance_m)
    assert found == pytest.approx([0.0, 3.0, 5.0, 9.0, 9.0, 12.0])


def test_a_path_is_measured_in_chords_of_half_a_second() -> None:
    """The path is two metres along a line with a sway of 5 cm at 2 Hz, then one metre to the left."""
    time_s = np.arange(0.0, 2.0, 0.01)
    along = np.column_stack([time_s, 0.05 * np.sin(4 * np.pi * time_s), np.full_like(time_s, 0.3)])
    assert path_length(along, 100.0) == pytest.approx(1.99, abs=0.01)
    corner = np.repeat([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 9.0]], 50, axis=0)
    assert path_length(corner, 100.0) == pytest.approx(3.0)


def test_the_mean_velocity_is_over_all_samples() -> None:
    progress = Progress(10.0)
    assert np.isnan(progress.mean_velocity).all()
    assert progress.distance_m == 0.0
    step, still = np.arange(4.0), np.zeros(4)
    positions = np.column_stack([0.1 * step, still, still])
    velocities = np.column_stack([step, still + 1.0, -step])
    for part in (slice(0, 3), slice(3, 4)):
        progress.add(positions[part], velocities[part])
    np.testing.assert_allclose(progress.mean_velocity, [1.5, 1.0, -1.5])
    assert progress.distance_m == pytest.approx(0.3)


def test_the_power_is_a_mean_over_the_steps_since_it_was_last_taken(go1: Robot) -> None:
    """Memory does not grow while the power is not taken, since a simulated robot may run for hours."""
    meter, rng = EnergyMeter(go1), np.random.default_rng(4)
    unmoved, taken, expected = meter.take(), [], []
    assert (unmoved.electrical, unmoved.mechanical, unmoved.positive) == (0.0, 0.0, 0.0)
    resistance, constant, gear = np.full(12, 0.17), np.full(12, 0.105), np.tile([6.0, 6.0, 9.0], 4)
    for steps in (200, 3, 0, 64):
        torque, before, after = rng.normal(size=(3, steps, 12)) * 5.0
        for row in zip(torque, before, after, strict=True):
            meter.add(*row)
        shaft = torque * (before + after) / 2
        electrical = shaft + resistance * (torque / (gear * constant)) ** 2
        sums = np.array([electrical.sum(), shaft.sum(), shaft[shaft > 0].sum()])
        taken.append(meter.take())
        expected.append(sums / max(steps, 1))
    for power, sums in zip(reversed(taken), reversed(expected), strict=True):
        np.testing.assert_allclose([power.electrical, power.mechanical, power.positive], sums)
    tracemalloc.start()
    try:
        for _ in range(5000):
            meter.add(*np.ones((3, 12)))
        assert tracemalloc.get_traced_memory()[0] < 200_000
    finally:
        tracemalloc.stop()
    assert meter.take().mechanical == pytest.approx(12.0)
