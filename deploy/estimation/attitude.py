"""Attitude from gyro and accelerometer, for an IMU without orientation.

An error-state Kalman filter. The gyro rotates the attitude; the accelerometer, which measures the vertical
plus the base's own acceleration, corrects tilt and gyro bias. The accelerations of a walk average out over a
few steps, so they count as noise. Yaw starts at zero and drifts with the remaining bias about the vertical.
The noise is isotropic: both horizontal axes share one 2 by 2 covariance of tilt and bias. It uses Python
floats, like the motion filter.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.estimation.config import AttitudeConfig

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # w, x, y, z, body to world


class Attitude(NamedTuple):
    """Estimate of the attitude after a reading."""

    quaternion: Quaternion
    bias: Vector  # gyro bias, rad/s, body frame
    gyro: Vector  # latest reading, rad/s
    tilt_variance: float  # rad^2, for each horizontal axis
    covariance: float  # rad^2/s, between tilt and bias
    bias_variance: float  # (rad/s)^2


def attitude_at_rest(gyro: Vector, acceleration: Vector, config: AttitudeConfig) -> Attitude:
    """Attitude of a robot at rest, with a yaw of zero.

    Args:
        gyro: mean reading, rad/s, which is the bias.
        acceleration: mean reading, m/s^2, which is vertical.
        config: noise figures.
    """
    x, y, z = acceleration
    length = math.hypot(x, y, z) or 1.0
    x, y, z = x / length, y / length, z / length
    # Smallest rotation from the vertical in the body frame to the world's z axis.
    quaternion = _unit(1.0 + z, y, -x, 0.0) if z > -0.999999 else (0.0, 1.0, 0.0, 0.0)
    return initial_attitude(quaternion, gyro, config)._replace(bias=gyro)


def initial_attitude(quaternion: Sequence[float], gyro: Sequence[float], config: AttitudeConfig) -> Attitude:
    """Initial estimate from a known attitude and a gyro, rad/s, without bias."""
    w, x, y, z = quaternion
    gx, gy, gz = gyro
    variances = config.start_tilt**2, 0.0, config.start_bias**2
    return Attitude((w, x, y, z), (0.0, 0.0, 0.0), (gx, gy, gz), *variances)


def advanced(
    before: Attitude, gyro: Vector, acceleration: Vector, dt_s: float, config: AttitudeConfig
) -> Attitude:
    """Attitude after the next reading.

    Args:
        before: attitude at the previous reading.
        gyro: rad/s, body frame.
        acceleration: proper, m/s^2, body frame.
        dt_s: time since the previous reading, > 0.
        config: noise figures.
    """
    (gx, gy, gz), (bx, by, bz), (lx, ly, lz) = gyro, before.bias, before.gyro
    half = 0.5 * dt_s
    turn = half * (gx + lx) - dt_s * bx, half * (gy + ly) - dt_s * by, half * (gz + lz) - dt_s * bz
    quaternion = _turned(before.quaternion, turn)
    # F P F' + Q of tilt' = tilt - bias dt.
    tilt_variance, covariance, bias_variance = before.tilt_variance, before.covariance, before.bias_variance
    tilt_variance += dt_s * (dt_s * bias_variance - 2.0 * covariance + config.gyro_noise**2)
    covariance -= dt_s * bias_variance
    bias_variance += dt_s * config.bias_drift**2
    ex, ey, ez = _indicated_tilt(acceleration, _up(quaternion))
    noise = (config.acceleration_noise / GRAVITY_M_S2) ** 2 / dt_s
    tilt_gain, bias_gain = tilt_variance / (tilt_variance + noise), covariance / (tilt_variance + noise)
    return Attitude(
        _turned(quaternion, (tilt_gain * ex, tilt_gain * ey, tilt_gain * ez)),
        (bx + bias_gain * ex, by + bias_gain * ey, bz + bias_gain * ez),
        gyro,
        tilt_variance - tilt_gain * tilt_variance,
        covariance - tilt_gain * covariance,
        bias_variance - bias_gain * covariance,
    )


def leveled(
    attitude: Attitude, bias: Sequence[float], config: AttitudeConfig
) -> tuple[Attitude, tuple[float, float, float]]:
    """Attitude corrected by stance legs, and the remaining bias of the accelerometer.

    A filter that gets the base's motion from the legs sees a wrong tilt as a horizontal bias of the
    accelerometer: gravity times the error. At rest, sensors cannot distinguish the two.

    Args:
        attitude: attitude that gave the filter's rotation.
        bias: bias of the accelerometer, m/s^2, body frame.
        config: settings.
    """
    ux, uy, uz = up = _up(attitude.quaternion)
    ex, ey, ez = _indicated_tilt(bias, up)
    (gx, gy, gz), gain = attitude.bias, config.legs_bias_hz
    upward = bias[0] * ux + bias[1] * uy + bias[2] * uz
    corrected = attitude._replace(
        quaternion=_turned(attitude.quaternion, (ex, ey, ez)),
        bias=(gx - gain * ex, gy - gain * ey, gz - gain * ez),
    )
    return corrected, (upward * ux, upward * uy, upward * uz)


class AttitudeEstimator:
    """Attitude since the first rest: the filter starts with the mean readings over `rest_s` at rest."""

    def __init__(self, config: AttitudeConfig) -> None:
        self._config = config
        self._sum = [0.0] * 6  # sum of the readings at rest: gyro, acceleration
        self._count, self._rested_s = 0, 0.0
        self.attitude: Attitude | None = None  # None until the robot has been at rest long enough

    def update(self, gyro: Sequence[float], acceleration: Sequence[float], dt_s: float) -> Attitude | None:
        """Update with a reading, rad/s and m/s^2, body frame, `dt_s` after the previous one; 0 for the
        first."""
        (gx, gy, gz), (ax, ay, az) = gyro, acceleration
        if self.attitude is None:
            self._average_rest((gx, gy, gz, ax, ay, az), dt_s)
        elif dt_s > 0.0:
            self.attitude = advanced(self.attitude, (gx, gy, gz), (ax, ay, az), dt_s, self._config)
        return self.attitude

    def _average_rest(self, reading: tuple[float, ...], dt_s: float) -> None:
        if max(map(abs, reading[:3])) > self._config.rest_rad_s:
            self._sum, self._count, self._rested_s = [0.0] * 6, 0, 0.0
            return
        self._rested_s += dt_s if self._count else 0.0
        self._sum = [total + value for total, value in zip(self._sum, reading, strict=True)]
        self._count += 1
        if self._rested_s >= self._config.rest_s:
            gx, gy, gz, ax, ay, az = (total / self._count for total in self._sum)
            self.attitude = attitude_at_rest((gx, gy, gz), (ax, ay, az), self._config)


def _up(quaternion: Quaternion) -> Vector:
    """The vertical in the body frame."""
    w, x, y, z = quaternion
    return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)


def _indicated_tilt(acceleration: Sequence[float], up: Vector) -> Vector:
    """Tilt error indicated by an acceleration (m/s^2) besides gravity: horizontal, rad, body frame."""
    x, y, z = (value / GRAVITY_M_S2 for value in acceleration)
    ux, uy, uz = up
    return y * uz - z * uy, z * ux - x * uz, x * uy - y * ux


def _turned(quaternion: Quaternion, turn: Vector) -> Quaternion:
    """Quaternion after a rotation of the body, a rotation vector in its own frame."""
    (w, x, y, z), (tx, ty, tz) = quaternion, turn
    angle = math.hypot(tx, ty, tz)
    scale = math.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    c, tx, ty, tz = math.cos(0.5 * angle), scale * tx, scale * ty, scale * tz
    return _unit(
        w * c - x * tx - y * ty - z * tz,
        w * tx + x * c + y * tz - z * ty,
        w * ty - x * tz + y * c + z * tx,
        w * tz + x * ty - y * tx + z * c,
    )


def _unit(w: float, x: float, y: float, z: float) -> Quaternion:
    length = math.sqrt(w * w + x * x + y * y + z * z)
    return w / length, x / length, y / length, z / length
