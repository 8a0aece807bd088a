"""Attitude by gyro and accelerometer, the gyro's bias by the IMU's orientation, and attitude by legs."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from moments import UP, under_load
from scipy.spatial.transform import Rotation

from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.estimation.attitude import Attitude, AttitudeEstimator, advanced, attitude_at_rest
from footfall.deploy.estimation.config import AttitudeConfig, GyroConfig
from footfall.deploy.estimation.gyro import GyroBias
from footfall.deploy.leg_attitude import LegAttitude
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.robots.description import Robot

DT_S, CONFIG = 0.002, AttitudeConfig()
LIMITS, WINDOW_S = SensorLimits(), 0.04
BIAS = np.array([0.03, -0.02, 0.01])
angles = st.floats(-1.5, 1.5)


def tilt_error(found: Attitude, true: Rotation) -> float:
    """Angle between the estimated and the true vertical, rad."""
    estimated = Rotation.from_quat(found.quaternion, scalar_first=True)
    return float(np.linalg.norm(estimated.inv().apply(UP) - true.inv().apply(UP)))


def follow(found: Attitude, true: Rotation, rate: np.ndarray, seconds: float) -> tuple[Attitude, Rotation]:
    """Turn steadily about the body's axes, with a gyro that has a bias."""
    turned = true * Rotation.from_rotvec(np.outer(np.arange(round(seconds / DT_S)) + 1, rate * DT_S))
    gyro = tuple((rate + BIAS).tolist())
    for acceleration in turned.inv().apply(GRAVITY_M_S2 * UP).tolist():
        found = advanced(found, gyro, tuple(acceleration), DT_S, CONFIG)
    return found, turned[-1]


def rested(true: Rotation, bias: np.ndarray) -> Attitude:
    acceleration = true.inv().apply(GRAVITY_M_S2 * UP)
    return attitude_at_rest(tuple(bias.tolist()), tuple(acceleration.tolist()), CONFIG)


@given(angles, angles, angles)
@example(np.pi, 0.0, 0.0)  # on its back
def test_at_rest_the_accelerometer_gives_the_tilt(roll: float, pitch: float, yaw: float) -> None:
    true = Rotation.from_euler("xyz", [roll, pitch, yaw])
    found = rested(true, BIAS)
    assert tilt_error(found, true) < 1e-9
    assert found.bias == tuple(BIAS)


@pytest.mark.parametrize("rate", [[0.0, 0.0, 1.0], [2.0, -1.0, 0.5], [0.0, 3.0, 0.0]])
def test_the_filter_turns_with_the_gyro_minus_its_bias(rate: list[float]) -> None:
    start = Rotation.from_euler("xyz", [0.1, -0.2, 0.0])
    first = rested(start, BIAS)
    yaw = start * Rotation.from_quat(first.quaternion, scalar_first=True).inv()  # the filter's is zero
    found, true = follow(first, start, np.array(rate), 5.0)
    turned = yaw * Rotation.from_quat(found.quaternion, scalar_first=True)
    assert (turned.inv() * true).magnitude() < 0.004  # it starts to turn between two readings


def test_a_gyro_bias_that_appears_later_is_found() -> None:
    """The gyro warms up, which adds a bias of 0.03 rad/s. The bias about the vertical stays unknown."""
    true = Rotation.from_euler("xyz", [0.05, 0.1, 0.0])
    found, true = follow(rested(true, np.zeros(3)), true, np.zeros(3), 60.0)
    level = true.inv().apply(UP)
    missing = BIAS - found.bias
    assert np.linalg.norm(missing - level * (level @ missing)) < 1e-3
    assert tilt_error(found, true) < 0.005


def test_the_filter_starts_after_the_robot_has_kept_still() -> None:
    """Readings do not count while the robot is carried."""
    estimator, leaning = AttitudeEstimator(CONFIG), [3.0, 0.0, 9.3]
    for gyro in [[0.0, 0.0, 0.02]] * 100 + [[0.0, 0.5, 0.0]]:
        assert estimator.update(gyro, leaning, DT_S) is None
    started = [estimator.update([0.0, 0.0, 0.01], [0.0, 0.0, GRAVITY_M_S2], DT_S) for _ in range(260)]
    assert started.index(next(filter(None, started))) == pytest.approx(CONFIG.rest_s / DT_S, abs=1)
    assert tilt_error(started[-1], Rotation.identity()) < 1e-6
    assert started[-1].bias == pytest.approx((0.0, 0.0, 0.01))


def found_rate(estimator: GyroBias, rate: np.ndarray, seconds: float, noise: float = 0.0) -> list[float]:
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
    assert found_rate(estimator, rate, 10.0) == pytest.approx(rate, abs=1e-3)
    assert estimator.bias == pytest.approx(BIAS, abs=1e-3)


def test_an_averaging_time_below_one_step_is_one_step() -> None:
    short, step = (GyroBias(GyroConfig(bias_filter_s=time_s)) for time_s in (1e-6, DT_S))
    assert found_rate(short, np.zeros(3), 0.2, noise=1e-6) == found_rate(step, np.zeros(3), 0.2, noise=1e-6)


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


def update_by_legs(attitude: LegAttitude, robot: Robot, pitch: float, *loads: float) -> None:
    """Readings at rest of a base that is pitched back; loads are the feet's shares of an even load."""
    up = np.array([math.sin(pitch), 0.0, math.cos(pitch)])
    even_n = 9.81 * robot.legs.mass / robot.legs.count
    sensed = under_load(robot, even_n * np.outer(loads or np.ones(4), up), 9.81 * up)
    attitude.update(sensed.joint_position, sensed.joint_torque, up, WINDOW_S)


def settled_on_legs(robot: Robot, pitch: float) -> LegAttitude:
    attitude = LegAttitude(robot, LIMITS)
    for _ in range(2 + round(LIMITS.resting_s / WINDOW_S)):
        update_by_legs(attitude, robot, pitch)
    return attitude


@pytest.mark.parametrize("angle", [0.0, 0.2, -0.5])
def test_both_attitudes_differ_by_the_angle_of_a_slope_or_by_a_turn(go1: Robot, angle: float) -> None:
    """A base that turns without its legs is a contradiction."""
    attitude = settled_on_legs(go1, angle)
    assert attitude.slope == pytest.approx(abs(angle), abs=1e-3)
    assert attitude.turn == pytest.approx(0.0, abs=1e-9)
    update_by_legs(attitude, go1, angle + 0.1)
    assert attitude.turn == pytest.approx(0.1, rel=1e-3)


def test_three_other_feet_start_a_new_comparison(go1: Robot) -> None:
    attitude = settled_on_legs(go1, 0.0)
    update_by_legs(attitude, go1, 0.1, 1.0, 1.0, 1.0, 0.0)
    assert attitude.turn == 0.0
    update_by_legs(attitude, go1, 0.3, 1.0, 1.0, 1.0, 0.0)
    assert attitude.turn == pytest.approx(0.2, rel=1e-2)
