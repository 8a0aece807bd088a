"""Checks the IMU against gravity while the robot keeps still, before its motors get stiffness."""

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.rotations import rotation_matrix
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.modes import Mode
from footfall.deploy.sensor_checks.imu import ImuLimits
from footfall.deploy.signals import Implausible

AT_REST = np.array([0.0, 0.0, GRAVITY_M_S2])  # what an accelerometer reads, world axes, m/s^2


class FirstRest:
    """Averages accelerations while the robot keeps still: motion would hide gravity."""

    def __init__(self, still_s: float, limits: ImuLimits, places: list[str]) -> None:
        """No reading has come yet.

        Args:
            still_s: how long the robot has to keep still; 0 for not at all.
            limits: what counts as still, and as gravity.
            places: of the joints, for messages.
        """
        self._still_s, self._limits = still_s, limits
        self._sources = [*("the IMU's gyro",) * 3, *places]  # of each speed
        self._since_us: int | None = None
        self._sum, self._count = np.zeros(3), 0  # of accelerations since then, world axes
        self._speed = np.zeros(len(self._sources))  # of the base about its axes and of the joints, rad/s

    def look(self, now_us: int, inertial: Inertial, velocity: np.ndarray) -> None:
        """Take in a tick's readings; `velocity` is that of the joints, rad/s, (n,)."""
        self._speed = np.abs(np.concatenate((inertial.gyro, velocity)))
        still = bool((self._speed < self._limits.resting_rad_s).all())
        if self._since_us is None or not still:
            self._since_us, self._sum, self._count = now_us, np.zeros(3), 0
        if still:  # a jolt, as of being set down, would outweigh many readings at rest
            self._sum = self._sum + rotation_matrix(np.array(inertial.quaternion)) @ inertial.acceleration
            self._count += 1

    def awaited(self, now_us: int) -> str:
        """Why a robot that answers is not ready; empty once it has kept still for long enough."""
        if self._since_us is None or now_us - self._since_us >= 1e6 * self._still_s:
            return ""
        fastest = int(self._speed.argmax())
        return (
            f"the robot does not keep still for {self._still_s:g} s before it gets stiffness:"
            f" {self._sources[fastest]} reads {self._speed[fastest]:.2f} rad/s"
        )

    def contradiction(self) -> Implausible | None:
        """The fault if the mean acceleration differs too much from 1 g upwards; None otherwise."""
        if not self._still_s or not self._count:
            return None
        error = float(np.linalg.norm(self._sum / self._count - AT_REST) / AT_REST[2])
        if error <= self._limits.rest_error:
            return None
        fault = f"the IMU: before the start its acceleration is off its quaternion's gravity by {error:.0%}"
        return Implausible(fault, Mode.ESTOP)
