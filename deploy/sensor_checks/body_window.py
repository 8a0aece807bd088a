"""Readings of the base in a window: reports of the IMU, and values computed from them."""

import math
from collections.abc import Sequence
from operator import mul
from typing import NamedTuple

import numpy as np

from footfall.common.rotations import quaternion_product, rotation_rows
from footfall.deploy.drivers.imu import Inertial


class BodyReadings(NamedTuple):
    """Readings of the base between two comparisons."""

    elapsed_s: float
    before: Inertial  # last reading of the previous window
    inertials: list[Inertial]
    position: np.ndarray  # joint positions at the end, rad, (n,)
    torque: np.ndarray  # mean of the reported torques, N m, (n,)
    fastest: float  # mean speed of the fastest joint, rad/s


class BodyWindow(NamedTuple):
    """Values computed from the readings of a window."""

    readings: BodyReadings
    on_legs: bool  # whether the legs should carry the base
    gyro: list[float]  # mean, rad/s, body axes
    acceleration: list[float]  # mean of the body-axes readings, in world axes at the end, m/s^2
    up: np.ndarray  # world's up in the body's axes at the end, (3,)
    turn: list[float]  # rotation of the base by the quaternions, rad, about each body axis
    gyro_turn: list[float]  # rotation of the base by the gyro
    slope_rad: float = 0.0  # angle between the plane of the standing feet and the IMU's level
    leg_turn_rad: float = 0.0  # rotation of the base since these feet stand, by the IMU minus by the legs

    @property
    def elapsed_s(self) -> float:
        return self.readings.elapsed_s


def body_window(readings: BodyReadings, on_legs: bool) -> BodyWindow:
    """Window of these readings.

    Computed in Python floats, which take half of the time of short arrays.
    """
    quaternion = readings.inertials[-1].quaternion
    w, x, y, z = readings.before.quaternion
    gyro, acceleration = (
        [sum(values) / len(readings.inertials) for values in zip(*parts, strict=True)]
        for parts in list(zip(*readings.inertials, strict=True))[:2]
    )
    to_world = rotation_rows(quaternion)
    return BodyWindow(
        readings,
        on_legs,
        gyro,
        [sum(map(mul, row, acceleration)) for row in to_world],
        np.array(to_world[2]),
        _rotation_vector(quaternion_product((w, -x, -y, -z), quaternion)),
        _gyro_turn(readings, gyro),
    )


def _rotation_vector(quaternion: Sequence[float]) -> list[float]:
    """Axis times angle of a rotation by less than half a turn, rad."""
    w, *axis = quaternion
    sine = math.hypot(*axis)  # sine of half the angle
    scale = 2.0 if sine < 1e-6 else 2.0 * math.atan2(sine, abs(w)) / sine
    return [math.copysign(scale, w) * part for part in axis]


def _gyro_turn(readings: BodyReadings, mean: Sequence[float]) -> list[float]:
    """Gyro rates integrated from the last reading before the window, by trapezoids, rad.

    A base that hits the ground changes its rate by many rad/s in a window: a plain mean would be wrong by
    half of it.
    """
    step_s = readings.elapsed_s / len(readings.inertials)
    first, last = readings.before.gyro, readings.inertials[-1].gyro
    return [
        rate * readings.elapsed_s + 0.5 * step_s * (a - b)
        for rate, a, b in zip(mean, first, last, strict=True)
    ]
