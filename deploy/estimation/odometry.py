"""Pose of the base since the start, with its covariance."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from footfall.deploy.estimation.config import OdometryConfig

POSITION, YAW, VELOCITY = slice(0, 3), 3, slice(4, 7)  # rows of the covariance


class Odometry(NamedTuple):
    """Estimated motion of the base. Frame: origin and heading (x) of the base at the start, z up."""

    position: np.ndarray  # (3,) m
    orientation: np.ndarray  # (4,) w x y z, body to this frame, based on the IMU's
    yaw: float  # rad, in [-pi, pi), yaw of this orientation
    velocity: np.ndarray  # (3,) m/s, body frame
    angular_velocity: np.ndarray  # (3,) rad/s, body frame, without the gyro's bias
    height: float  # m above the centre of the mean standing foot
    contact: np.ndarray  # (legs,) probability that each foot is in stance
    covariance: np.ndarray  # (7, 7) covariance of position, yaw, velocity


class DelayUncertainty:
    """Uncertainty of the velocity due to the delay of readings.

    The delay is unknown, and a swaying body changes its velocity during it. A first-order filter with the
    delay as its time constant lags by this change: acceleration times delay. The covariance is the mean
    square of this lag over about one step.

    It uses Python floats, like the filter.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Start with zero lag."""
        self._filtered: Sequence[float] | None = None  # filtered velocity
        self._xx = self._xy = self._xz = self._yy = self._yz = self._zz = 0.0

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the velocity, (3, 3), m^2/s^2."""
        xy, xz, yz = self._xy, self._xz, self._yz
        return np.array([[self._xx, xy, xz], [xy, self._yy, yz], [xz, yz, self._zz]])

    def advance(self, velocity: Sequence[float], dt_s: float) -> None:
        """Add a time step with a velocity (x, y, z), m/s."""
        (vx, vy, vz), (fx, fy, fz) = velocity, self._filtered or velocity
        share = dt_s / (self._config.latency_s + dt_s)
        fx, fy, fz = fx + share * (vx - fx), fy + share * (vy - fy), fz + share * (vz - fz)
        self._filtered = fx, fy, fz
        x, y, z = vx - fx, vy - fy, vz - fz
        share = dt_s / (self._config.latency_filter_s + dt_s)
        self._xx += share * (x * x - self._xx)
        self._xy += share * (x * y - self._xy)
        self._xz += share * (x * z - self._xz)
        self._yy += share * (y * y - self._yy)
        self._yz += share * (y * z - self._yz)
        self._zz += share * (z * z - self._zz)


class PoseUncertainty:
    """Uncertainty of the pose that grows with the distance, in the frame of the IMU's orientation.

    No reading shows these three errors: yaw drifts (a random walk that rotates the path), the scale is wrong
    (limbs differ from the description), and feet slip slightly at each step.
    """

    def __init__(self, config: OdometryConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Start at the current pose."""
        self._time = self._distance = self._fall_variance = 0.0
        self._yaw_x = self._yaw_y = 0.0  # covariance of position and yaw
        self._xx = self._xy = self._yy = 0.0  # covariance of the position due to the yaw

    def add_fall(self) -> None:
        """Add a fall, in which the robot slid, rolled and got up along an unknown path."""
        self._fall_variance += self._config.fall_m**2

    def advance(self, velocity: Sequence[float], dt_s: float) -> None:
        """Add a time step with a velocity (x, y, z), m/s."""
        x, y, _ = velocity
        self._time += dt_s
        self._distance += math.hypot(x, y) * dt_s
        yaw_variance_s = self._config.yaw_drift**2 * self._time * dt_s
        self._yaw_x -= yaw_variance_s * y
        self._yaw_y += yaw_variance_s * x
        self._xx -= 2.0 * dt_s * y * self._yaw_x
        self._xy += dt_s * (x * self._yaw_x - y * self._yaw_y)
        self._yy += 2.0 * dt_s * x * self._yaw_y

    def covariance(self, displacement: np.ndarray) -> np.ndarray:
        """Covariance of position and yaw, (4, 4), after a displacement (3,), m, with z integrated."""
        config = self._config
        result = np.zeros((4, 4))
        result[:2, :2] = (self._xx, self._xy), (self._xy, self._yy)
        result[:2, YAW] = result[YAW, :2] = self._yaw_x, self._yaw_y
        result[YAW, YAW] = config.orientation_noise**2 + config.yaw_drift**2 * self._time
        result[:3, :3] += config.scale_error**2 * np.outer(displacement, displacement)
        result[:3, :3] += (config.slip**2 * self._distance + self._fall_variance) * np.eye(3)
        result[2, 2] += (config.climb_error * self._distance) ** 2
        return result
