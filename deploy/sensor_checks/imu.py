"""Checks of the IMU's parts against each other: gyro, acceleration and quaternion."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from footfall.common.config import require_between
from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.sensor_checks.body_window import BodyWindow
from footfall.deploy.sensor_checks.check import BodyCheck, Limit
from footfall.deploy.sensor_checks.memory import Memory
from footfall.robots.description import Robot


@dataclass(frozen=True)
class ImuLimits(Memory):
    """Limits of the disagreement between the parts of the IMU."""

    rotation_rad: float = 0.08  # rotation by the quaternion minus rotation by the gyro
    imu_repeated_s: float = 0.03  # time for which a part of the IMU repeats while joints move
    turned_rad: float = 0.001  # rotation of the base in a window: a smaller one may be hidden by rounding
    moving_rad_s: float = 0.5  # joint speed above which a base shakes by more than the IMU's resolution
    resting_rad_s: float = 0.3  # below it, for `resting_s`, a joint or the base is at rest
    resting_s: float = 0.3
    rest_error: float = 0.15  # of gravity: acceleration at rest minus the quaternion's gravity
    lateral_error: float = 0.45  # of gravity: mean lateral error in motion; a slide from 6 m/s has 0.4
    long_lateral_error: float = 0.12  # of gravity: mean lateral error over `long_lateral_memory_s`
    long_lateral_memory_s: float = 3.0
    lift_error: float = 0.6  # of gravity: upward; a robot that is thrown or falls over has less
    lean_memory_s: float = 1.0  # averaging time, over which a walk's accelerations cancel out

    def __post_init__(self) -> None:
        super().__post_init__()
        require_between(self, 0.001, 2 * np.pi, "rotation_rad", "turned_rad")
        require_between(
            self, 0.01, 10.0, "imu_repeated_s", "resting_s", "lean_memory_s", "long_lateral_memory_s"
        )
        require_between(self, 0.01, 100.0, "moving_rad_s", "resting_rad_s")
        require_between(self, 0.01, 2.0, "rest_error", "lateral_error", "long_lateral_error", "lift_error")


class Rotation(BodyCheck):
    """Rotation of the base by the quaternion minus that by the gyro, rad."""

    quantity = "rotation by the quaternion against rotation by the gyro"
    message = "the IMU: its quaternion turned by {0:.2f} rad against its gyro"
    limit = Limit("rotation_rad")

    _limits: ImuLimits

    def reset(self) -> None:
        self._error = [0.0, 0.0, 0.0]

    def measure(self, window: BodyWindow) -> float:
        kept = self._limits.kept(window.elapsed_s)
        self._error = [
            kept * error + turn - by_gyro
            for error, turn, by_gyro in zip(self._error, window.turn, window.gyro_turn, strict=True)
        ]
        return math.hypot(*self._error)


class _PartRepeated(BodyCheck):
    """Time for which a part of the IMU has repeated exactly while joints move, s.
    Only for a robot on its legs: a lying or hanging robot may be at rest.
    """

    limit = Limit("imu_repeated_s")
    part: ClassVar[str]  # field of `Inertial`

    def __init__(self, robot: Robot, limits: ImuLimits, sample_s: float) -> None:
        self._limits, self._index = limits, Inertial._fields.index(self.part)
        self.reset()

    def reset(self) -> None:
        self._repeated_s = 0.0

    def measure(self, window: BodyWindow) -> float:
        readings = window.readings
        before = readings.before[self._index]
        if any(inertial[self._index] != before for inertial in readings.inertials):
            self._repeated_s = 0.0
        elif readings.fastest > self._limits.moving_rad_s and window.on_legs:
            self._repeated_s += self._weight(window) * readings.elapsed_s
        return self._repeated_s

    def _weight(self, window: BodyWindow) -> float:
        """Gyro and quaternion count only if they disagree: a smooth motion has a constant rate for a
        while."""
        error = max(abs(a - b) for a, b in zip(window.turn, window.gyro_turn, strict=True))
        return float(error > self._limits.turned_rad)


class GyroRepeated(_PartRepeated):
    """Repeated gyro readings."""

    part = "gyro"
    quantity = "time for which the gyro repeats one value while joints move"
    message = "the IMU: its gyro has repeated itself for {0:.2f} s while joints moved"


class AccelerationRepeated(_PartRepeated):
    """Repeated acceleration readings."""

    part = "acceleration"
    quantity = "time for which the acceleration repeats one value while joints move"
    message = "the IMU: its acceleration has repeated itself for {0:.2f} s while joints moved"

    def _weight(self, window: BodyWindow) -> float:
        """Half if the base has not rotated, because gravity's share of the acceleration is then constant."""
        turned = max(map(abs, (*window.turn, *window.gyro_turn)))
        return 1.0 if turned > self._limits.turned_rad else 0.5


class QuaternionRepeated(_PartRepeated):
    """Repeated quaternions."""

    part = "quaternion"
    quantity = "time for which the quaternion repeats one value while joints move"
    message = "the IMU: its quaternion has repeated itself for {0:.2f} s while joints moved"


class RestError(BodyCheck):
    """Difference between the mean acceleration at rest and the opposite of gravity, relative to gravity."""

    quantity = "acceleration at rest against the quaternion's gravity: an IMU that is tilted by 9 degrees"
    message = "the IMU: at rest its acceleration differs from its quaternion's gravity by {0:.0%}"
    limit = Limit("rest_error")

    _limits: ImuLimits

    def reset(self) -> None:
        self._rest_s = 0.0
        self._mean = [0.0, 0.0, 0.0]  # world axes, m/s^2

    def measure(self, window: BodyWindow) -> float:
        limits, elapsed_s = self._limits, window.elapsed_s
        if max(window.readings.fastest, *map(abs, window.gyro)) >= limits.resting_rad_s:
            self._rest_s = 0.0
            return 0.0
        min_weight = 1.0 - math.exp(-elapsed_s / limits.lean_memory_s)
        weight = max(elapsed_s / (self._rest_s + elapsed_s), min_weight)  # a plain mean at first
        self._mean = [
            mean + weight * (value - mean)
            for mean, value in zip(self._mean, window.acceleration, strict=True)
        ]
        self._rest_s += elapsed_s
        if self._rest_s < limits.resting_s:
            return 0.0
        x, y, z = self._mean
        return math.hypot(x, y, z - GRAVITY_M_S2) / GRAVITY_M_S2


class _MeanAcceleration(BodyCheck):
    """A check of the mean acceleration in motion, world axes, relative to gravity."""

    memory: ClassVar[str] = "lean_memory_s"  # field of `ImuLimits`

    def __init__(self, robot: Robot, limits: ImuLimits, sample_s: float) -> None:
        self._limits, self._memory_s = limits, getattr(limits, self.memory)
        self.reset()

    def reset(self) -> None:
        self._mean = [0.0, 0.0, GRAVITY_M_S2]

    def _updated(self, window: BodyWindow) -> list[float]:
        kept = math.exp(-window.elapsed_s / self._memory_s)
        self._mean = [
            kept * mean + (1 - kept) * value
            for mean, value in zip(self._mean, window.acceleration, strict=True)
        ]
        return self._mean


class LateralError(_MeanAcceleration):
    """Mean lateral acceleration.

    A window counts with at most gravity, because no attitude error causes more. A robot that hits the ground
    at speed stops within one or two windows, at many times gravity.
    """

    quantity = "mean horizontal acceleration in motion against the quaternion's gravity"
    message = "the IMU: its acceleration leans away from its quaternion's gravity by {0:.0%}"
    limit = Limit("lateral_error")

    def measure(self, window: BodyWindow) -> float:
        x, y, z = window.acceleration
        share = min(1.0, self._max_value() * GRAVITY_M_S2 / max(math.hypot(x, y), 1e-9))
        x, y, _ = self._updated(window._replace(acceleration=[share * x, share * y, z]))
        return math.hypot(x, y) / GRAVITY_M_S2

    def _max_value(self) -> float:
        """Largest value of a window, relative to gravity."""
        return 1.0


class LongLateralError(LateralError):
    """Mean lateral acceleration over seconds, in which a robot's own accelerations cancel out.

    A window counts with at most twice the limit. A robot that was pushed hard slides until friction stops it,
    and an accelerometer may miss the push, which is short and beyond its range.
    """

    memory = "long_lateral_memory_s"
    quantity = "mean horizontal acceleration over seconds: an attitude drifts slowly, and the gyro agrees"
    limit = Limit("long_lateral_error")

    def _max_value(self) -> float:
        return 2.0 * self._limits.long_lateral_error


class Lift(_MeanAcceleration):
    """Difference between the mean upward acceleration and the opposite of gravity."""

    quantity = "mean vertical acceleration in motion against gravity: a wrong unit or sign"
    message = "the IMU: on average its acceleration is off gravity by {0:.0%}"
    limit = Limit("lift_error")

    def measure(self, window: BodyWindow) -> float:
        return abs(self._updated(window)[2] / GRAVITY_M_S2 - 1.0)
