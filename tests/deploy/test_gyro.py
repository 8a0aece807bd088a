"""The gyro's bias, found by how the IMU's orientation turns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from footfall.deploy.estimation.config import GyroConfig
from footfall.deploy.estimation.gyro import GyroBias

DT_S = 0.002
BIAS = np.array([0.03, -0.02, 0.01])


def follow(estimator: GyroBias, rate: np.ndarray, seconds: float, noise: float = 0.0) -> list[float]:
    """Turn steadily at a rate about the body's axes; returns the last estimate of it."""
    ticks = np.arange(1, round(seconds / DT_S) + 1)
    true = Rotation.from_rotvec([0.3, -0.4, 2.0]) * Rotation.from_rotvec(np.outer(ticks, rate * DT_S))
    errors = np.random.default_rng(0).uniform(-noise, noise, (len(ticks), 3))
    for quaternion in (true * Rotation.from_rotvec(errors)).as_quat(scalar_first=True).tolist():
        found = estimator.update((rate + BIAS).tolist(), quaternion, DT_S)
    return found


@pytest.mark.parametrize("rate", [np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([2.0, -1.0, 0.5])])
def test_the_bias_does_not_rotate_with_the_orientation(rate: np.ndarray) -> None:
    estimator = GyroBias(GyroConfig())
    assert follow(estimator, rate, 10.0) == pytest.approx(rate.tolist(), abs=1e-3)
    assert estimator.bias == pytest.approx(BIAS.tolist(), abs=1e-3)


def test_an_averaging_time_below_one_step_is_one_step() -> None:
    short, step = (GyroBias(GyroConfig(bias_filter_s=time_s)) for time_s in (1e-6, DT_S))
    assert follow(short, np.zeros(3), 0.2, noise=1e-6) == follow(step, np.zeros(3), 0.2, noise=1e-6)


def test_acceleration_is_no_bias() -> None:
    """Between two readings the robot turns by their mean: from 0 to 10 rad/s in half a second."""
    estimator, rates = GyroBias(GyroConfig()), np.linspace(0.0, 10.0, 251)
    angles = np.cumsum([0.0, *(0.5 * DT_S * (rates[:-1] + rates[1:]))])
    turned = Rotation.from_rotvec(np.outer(angles, [1.0, 0.0, 0.0])).as_quat(scalar_first=True)
    for rate, quaternion in zip(rates.tolist(), turned.tolist(), strict=True):
        estimator.update([rate, 0.0, 0.0], quaternion, DT_S)
    assert estimator.bias == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)


@given(st.integers(0, 999))
def test_a_quaternion_and_its_negative_are_one_orientation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    same, alternating = GyroBias(GyroConfig()), GyroBias(GyroConfig())
    turned = Rotation.from_rotvec(rng.normal(size=3)) * Rotation.from_rotvec(0.01 * rng.normal(size=(5, 3)))
    for step, quaternion in enumerate(turned.as_quat(scalar_first=True)):
        gyro = rng.normal(size=3).tolist()
        expected = same.update(gyro, quaternion.tolist(), DT_S)
        found = alternating.update(gyro, ((-1) ** step * quaternion).tolist(), DT_S)
        assert found == pytest.approx(expected, abs=1e-9)
