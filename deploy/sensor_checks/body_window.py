"""Readings of the base over a window: what the IMU reported, and what follows from it."""

from typing import NamedTuple

import numpy as np

from footfall.common.rotations import multiply, rotation_matrix
from footfall.deploy.drivers.imu import Inertial

CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


class BodyReadings(NamedTuple):
    """What is read of the base, from one comparison to the next."""

    elapsed_s: float
    before: Inertial  # the last reading of the window before
    inertials: list[Inertial]
    position: np.ndarray  # of the joints at the end, rad, (n,)
    torque: np.ndarray  # mean of the motors' reports, N m, (n,)
    fastest: float  # mean speed of the fastest joint, rad/s


class BodyWindow(NamedTuple):
    """What follows from the readings of a window."""

    readings: BodyReadings
    on_legs: bool  # whether the legs should carry the base
    gyro: list[float]  # mean, rad/s, body axes
    acceleration: list[float]  # mean of the body-axes readings, in world axes at the end, m/s^2
    up: np.ndarray  # the world's up in the body's axes at the end, (3,)
    turn: list[float]  # the base's turn by the quaternions, rad, about each body axis
    gyro_turn: list[float]  # the same by the gyro
    slope_rad: float = 0.0  # between the plane of the standing feet and the IMU's level
    leg_turn_rad: float = 0.0  # turn of the base since these feet stand, by the IMU less that by the legs

    @property
    def elapsed_s(self) -> float:
        return self.readings.elapsed_s


def body_window(readings: BodyReadings, on_legs: bool) -> BodyWindow:
    """The window of these readings."""
    last = readings.inertials[-1]
    quaternion = np.array(last.quaternion)
    gyro, acceleration = (
        [sum(values) / len(readings.inertials) for values in zip(*parts, strict=True)]
        for parts in list(zip(*readings.inertials, strict=True))[:2]
    )
    to_world = rotation_matrix(quaternion)
    w, *axis = multiply(CONJUGATE * readings.before.quaternion, quaternion).tolist()
    return BodyWindow(
        readings,
        on_legs,
        gyro,
        (to_world @ acceleration).tolist(),
        to_world[2],
        [2.0 * part if w >= 0.0 else -2.0 * part for part in axis],
        [rate * readings.elapsed_s for rate in gyro],
    )
