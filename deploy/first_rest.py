"""Check of the IMU against gravity while the robot is at rest, before its motors get stiffness."""

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.rotations import rotation_matrix
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.modes import Mode
from footfall.deploy.sensor_checks.imu import ImuLimits
from footfall.deploy.signals import Implausible

REST_ACCELERATION = np.array(
    [0.0, 0.0, GRAVITY_M_S2]
)  # reading of an accelerometer at rest, world axes, m/s^2


class FirstRest:
    """Averages accelerations while the robot is at rest, because motion would hide gravity."""

    def __init__(self, still_s: float, limits: ImuLimits, labels: list[str]) -> None:
        """Start without readings.

        Args:
            still_s: required time at rest; 0 for no check.
            limits: limits of rest and of the error of gravity.
            labels: names of the joints' motors, for messages.
        """
        self._still_s, self._limits = still_s, limits
        self._sources = [*("the IMU's gyro",) * 3, *labels]  # source of each speed
        self._since_us: int | None = None
        self._sum, self._count = np.zeros(3), 0  # sum of accelerations since then, world axes
        self._speed = np.zeros(len(self._sources))  # base about its axes, then joints, rad/s

    def update(self, now_us: int, inertial: Inertial, velocity: np.ndarray) -> None:
        """Update with the readings of a tick; `velocity` is that of the joints, rad/s, (n,)."""
        self._speed = np.abs(np.concatenate((inertial.gyro, velocity)))
        still = bool((self._speed < self._limits.resting_rad_s).all())
        if self._since_us is None or not still:
            self._since_us, self._sum, self._count = now_us, np.zeros(3), 0
        if still:  # a jolt, as from being set down, would outweigh many readings at rest
            self._sum = self._sum + rotation_matrix(np.array(inertial.quaternion)) @ inertial.acceleration
            self._count += 1

    def not_at_rest(self, now_us: int) -> str:
        """Why a robot with all readings is not ready; empty once it has been at rest long enough."""
        if self._since_us is None or now_us - self._since_us >= 1e6 * self._still_s:
            return ""
        fastest = int(self._speed.argmax())
        return (
            f"the robot is not at rest for {self._still_s:g} s before it gets stiffness:"
            f" {self._sources[fastest]} reads {self._speed[fastest]:.2f} rad/s"
        )

    def contradiction(self) -> Implausible | None:
        """The fault if the mean acceleration differs too much from 1 g upward; None otherwise."""
        if not self._still_s or not self._count:
            return None
        error = float(np.linalg.norm(self._sum / self._count - REST_ACCELERATION) / REST_ACCELERATION[2])
        if error <= self._limits.rest_error:
            return None
        fault = f"the IMU: at the start its acceleration differs from its quaternion's gravity by {error:.0%}"
        return Implausible(fault, Mode.ESTOP)
