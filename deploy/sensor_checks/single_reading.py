"""Checks of a joint that need one reading: its range, speed, torque, temperature and supply.

They also keep a motor from being given stiffness at the start.
"""

from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_between
from footfall.deploy.pose import beyond
from footfall.deploy.sensor_checks.check import JointCheck, Limit
from footfall.deploy.sensor_checks.joint_window import JointWindow
from footfall.robots.description import Robot


@dataclass(frozen=True)
class SingleReadingLimits:
    """How far one reading may be outside what the robot's description allows."""

    position_rad: float = 0.2  # beyond a joint's range: stops give way, and calibration is never exact
    speed_share: float = 1.5  # of the no-load speed: a push or a fall drives a motor beyond it
    torque_share: float = 1.2  # of the peak torque: rounding, and a motor's own idea of its constant
    voltage_v: float = 0.0  # that a supply may be outside its range

    def __post_init__(self) -> None:
        require_between(self, 0.001, 2 * np.pi, "position_rad")
        require_between(self, 1.0, 10.0, "speed_share", "torque_share")
        require_between(self, 0.0, 100.0, "voltage_v")


class PositionRange(JointCheck):
    """How far a joint is beyond its range, rad."""

    looks_at = "a joint's position beyond its range in the MJCF"
    message = "reads {1:.2f} rad, {0:.2f} rad beyond its range"
    limit = Limit("position_rad")
    single_reading = True

    def __init__(self, robot: Robot, limits: SingleReadingLimits, sample_s: float) -> None:
        self._lower, self._upper = robot.lower_rad, robot.upper_rad

    def measure(self, window: JointWindow) -> np.ndarray:
        return beyond(window.joints[0], self._lower, self._upper)


class Speed(JointCheck):
    """Speed of a joint, rad/s."""

    looks_at = "a joint's velocity"
    message = "turns at {0:.1f} rad/s, faster than its motor can"
    limit = Limit("speed_share", "no_load_speed_rad_s")
    single_reading = True

    def measure(self, window: JointWindow) -> np.ndarray:
        return np.abs(window.joints[1])


class Torque(JointCheck):
    """Size of a motor's reported torque, N m."""

    looks_at = "a motor's reported torque"
    message = "the motor reports {0:.1f} N m, more than it can"
    limit = Limit("torque_share", "peak_torque_nm")
    single_reading = True

    def measure(self, window: JointWindow) -> np.ndarray:
        return np.abs(window.joints[2])


class Temperature(JointCheck):
    """Temperature of a motor, degrees Celsius; 0 if it is below or not reported."""

    looks_at = "a motor's temperature, where the motor reports it"
    message = "the motor is at {0:.0f} degrees Celsius"
    limit = Limit(motor="temperature_limit_c")
    single_reading = True

    def measure(self, window: JointWindow) -> np.ndarray:
        return np.fmax(window.temperature_c, 0.0)  # fmax ignores NaN


class Voltage(JointCheck):
    """How far a motor's supply is outside its range, V; 0 if it is not reported."""

    looks_at = "a motor's voltage beyond `voltage_v` in robot.yaml, where the motor reports it"
    message = "the motor's supply is {0:.1f} V outside its range"
    limit = Limit("voltage_v")
    single_reading = True

    def __init__(self, robot: Robot, limits: SingleReadingLimits, sample_s: float) -> None:
        self._lowest, self._highest = robot.voltage_range

    def measure(self, window: JointWindow) -> np.ndarray:
        return np.fmax(beyond(window.voltage, self._lowest, self._highest), 0.0)  # fmax ignores NaN
