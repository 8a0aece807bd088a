"""The gyro's bias, found by how the IMU's orientation turns."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from footfall.common.rotations import multiply
from footfall.deploy.estimation.config import GyroConfig
from footfall.deploy.estimation.gyro import GyroBias

DT_S = 0.002
BIAS = np.array([0.03, -0.02, 0.01])


def turn(vector: np.ndarray) -> np.ndarray:
    """Quaternion of a rotation vector."""
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle else vector
    return np.array([np.cos(angle / 2), *np.sin(angle / 2) * axis])


def follow(estimator: GyroBias, rate: np.ndarray, seconds: float, noise: float = 0.0) -> list[float]:
    """Turn steadily at a rate about the body's axes; returns the last estimate of it."""
    rng = np.random.default_rng(0)
    quaternion = turn(np.array([0.3, -0.4, 2.0]))
    found = [0.0, 0.0, 0.0]
    for _ in range(round(seconds / DT_S)):
        quaternion = multiply(quaternion, turn(rate * DT_S))
        read = multiply(quaternion, turn(rng.uniform(-noise, noise, 3)))
        found = estimator.update((rate + BIAS).tolist(), read.tolist(), DT_S)
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
    estimator, quaternion = GyroBias(GyroConfig()), turn(np.zeros(3))
    rates = np.linspace(0.0, 10.0, 251)
    estimator.update([0.0, 0.0, 0.0], quaternion.tolist(), DT_S)
    for before, rate in pairwise(rates):
        quaternion = multiply(quaternion, turn(np.array([0.5 * (before + rate) * DT_S, 0.0, 0.0])))
        estimator.update([rate, 0.0, 0.0], quaternion.tolist(), DT_S)
    assert estimator.bias == pytest.approx([0.0, 0.0, 0.0], abs=1e-4)


@given(st.integers(0, 999))
def test_a_quaternion_and_its_negative_are_one_orientation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    estimators = GyroBias(GyroConfig()), GyroBias(GyroConfig())
    quaternion = turn(rng.normal(size=3))
    for step in range(5):
        quaternion = multiply(quaternion, turn(0.01 * rng.normal(size=3)))
        gyro = rng.normal(size=3).tolist()
        one = estimators[0].update(gyro, quaternion.tolist(), DT_S)
        other = estimators[1].update(gyro, (quaternion if step % 2 else -quaternion).tolist(), DT_S)
        assert other == pytest.approx(one, abs=1e-9)
