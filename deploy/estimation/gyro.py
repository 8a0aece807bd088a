"""Gyro bias, from the IMU's own orientation."""

import math

from footfall.deploy.estimation.config import GyroConfig

Vector = list[float]  # x, y, z


class GyroBias:
    """Gyro bias: mean gyro reading minus mean rate of the IMU's orientation.

    The contact point of a long leg appears to move by the bias times its length: 0.02 rad/s make a humanoid
    drift by 15 mm/s. Noise of the orientation averages out, because only its change over the whole time
    counts.

    It uses Python floats, like the filter.
    """

    def __init__(self, config: GyroConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Start with zero bias."""
        self.bias: Vector = [0.0, 0.0, 0.0]
        self._mean: Vector = [0.0, 0.0, 0.0]  # difference between gyro and orientation, rad/s
        self._time_s = 0.0  # averaging time of this difference
        self._last: tuple[Vector, Vector] | None = None

    def update(self, gyro: Vector, quaternion: Vector, dt_s: float) -> Vector:
        """Update with one set of readings.

        Args:
            gyro: rad/s, body frame.
            quaternion: w, x, y, z, body to world.
            dt_s: time since the previous readings.

        Returns:
            Angular velocity without the bias, rad/s, body frame.
        """
        if self._last is not None and dt_s > 0.0:
            (gx, gy, gz), (w, x, y, z) = self._last
            # Rotation from the last orientation to this one, a rotation vector in the body frame.
            qw, qx, qy, qz = quaternion
            real = w * qw + x * qx + y * qy + z * qz
            tx = w * qx - x * qw - y * qz + z * qy
            ty = w * qy + x * qz - y * qw - z * qx
            tz = w * qz - x * qy + y * qx - z * qw
            rate = math.copysign(2.0, real) / dt_s
            # At least one step: a shorter averaging time would weight the readings by more than one.
            self._time_s = time_s = max(min(self._time_s + dt_s, self._config.bias_filter_s), dt_s)
            share, (mx, my, mz) = dt_s / time_s, self._mean
            mx += share * (0.5 * (gx + gyro[0]) - rate * tx - mx)
            my += share * (0.5 * (gy + gyro[1]) - rate * ty - my)
            mz += share * (0.5 * (gz + gyro[2]) - rate * tz - mz)
            self._mean = [mx, my, mz]
            # The mean's noise is the orientation's divided by the time; the ratio of variances is its square.
            weight = time_s**2 / (time_s**2 + self._config.bias_half_s**2)
            self.bias = [weight * mx, weight * my, weight * mz]
        self._last = gyro, quaternion
        bx, by, bz = self.bias
        return [gyro[0] - bx, gyro[1] - by, gyro[2] - bz]
