"""Checks of a joint that need one reading: range, speed, torque, temperature and supply.

They also run before motors are enabled.
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
    """Tolerances of one reading relative to the robot's description."""

    position_rad: float = 0.2  # beyond a joint's range: stops are elastic, and calibration is not exact
    speed_share: float = 1.5  # of the no-load speed: a push or a fall can exceed it
    torque_share: float = 1.2  # of the peak torque: rounding, and error of the motor's torque constant
    colder_c: float = 25.0  # difference between a motor and all other motors
    coldest_c: float = 40.0  # degrees Celsius below zero: reading of an open sensor
    voltage_v: float = 0.0  # distance of a supply voltage from its range

    def __post_init__(self) -> None:
        require_between(self, 0.001, 2 * np.pi, "position_rad")
        require_between(self, 1.0, 10.0, "speed_share", "torque_share")
        require_between(self, 0.0, 100.0, "voltage_v")
        require_between(self, 1.0, 300.0, "colder_c", "coldest_c")


class PositionRange(JointCheck):
    """Distance of a joint beyond its range, rad."""

    quantity = "a joint's position beyond its range in the MJCF"
    message = "reads {1:.2f} rad, {0:.2f} rad beyond its range"
    limit = Limit("position_rad")
    single_reading = True

    def __init__(self, robot: Robot, limits: SingleReadingLimits, sample_s: float) -> None:
        self._lower, self._upper = robot.lower_rad, robot.upper_rad

    def measure(self, window: JointWindow) -> np.ndarray:
        return beyond(window.joints[0], self._lower, self._upper)


class Speed(JointCheck):
    """Speed of a joint, rad/s."""

    quantity = "a joint's velocity"
    message = "turns at {0:.1f} rad/s, faster than its motor can"
    limit = Limit("speed_share", "no_load_speed_rad_s")
    single_reading = True

    def measure(self, window: JointWindow) -> np.ndarray:
        return np.abs(window.joints[1])


class Torque(JointCheck):
    """Absolute torque reported by a motor, N m."""

    quantity = "a motor's reported torque"
    message = "the motor reports {0:.1f} N m, more than it can"
    limit = Limit("torque_share", "peak_torque_nm")
    single_reading = True

    def measure(self, window: JointWindow) -> np.ndarray:
        return np.abs(window.joints[2])


class Temperature(JointCheck):
    """Temperature of a motor, degrees Celsius; 0 if it is below 0 or not reported."""

    quantity = "a motor's temperature, where the motor reports it"
    message = "the motor is at {0:.0f} degrees Celsius"
    limit = Limit(motor="temperature_limit_c")
    single_reading = True

    def measure(self, window: JointWindow) -> np.ndarray:
        return np.fmax(window.temperature_c, 0.0)  # fmax ignores NaN


class ColderThanOthers(JointCheck):
    """Difference between a motor's temperature and those of all others, degrees Celsius.

    0 if it is not reported, and while all are within the limit.
    """

    quantity = "temperature of a motor below that of all others: an open sensor"
    message = "its temperature is {0:.0f} degrees below that of all other motors: its sensor may be open"
    limit = Limit("colder_c")
    single_reading = True

    def __init__(self, robot: Robot, limits: SingleReadingLimits, sample_s: float) -> None:
        self._limit_c, self._zeros = limits.colder_c, np.zeros(len(robot.joint_names))

    def measure(self, window: JointWindow) -> np.ndarray:
        temperature_c = window.temperature_c
        spread = np.fmax.reduce(temperature_c) - np.fmin.reduce(temperature_c)  # ignore NaN
        if not spread > self._limit_c:  # nearly always
            return self._zeros
        reported = np.where(np.isnan(temperature_c), np.inf, temperature_c)
        coldest, next_coldest = np.partition(reported, 1)[:2]
        others = np.where(reported == coldest, next_coldest, coldest)
        return np.where(np.isfinite(reported), others - temperature_c, 0.0)


class TooCold(JointCheck):
    """Reported degrees Celsius below zero; 0 for NaN."""

    quantity = "reported temperature below zero: an open sensor"
    message = "its temperature reads {0:.0f} degrees Celsius below zero: its sensor may be open"
    limit = Limit("coldest_c")
    single_reading = True

    def measure(self, window: JointWindow) -> np.ndarray:
        return np.fmax(-window.temperature_c, 0.0)


class Voltage(JointCheck):
    """Distance of a motor's supply voltage from its range, V; 0 if not reported."""

    quantity = "a motor's voltage beyond `voltage_v` in robot.yaml, where the motor reports it"
    message = "the motor's supply is {0:.1f} V outside its range"
    limit = Limit("voltage_v")
    single_reading = True

    def __init__(self, robot: Robot, limits: SingleReadingLimits, sample_s: float) -> None:
        self._lowest, self._highest = robot.voltage_range

    def measure(self, window: JointWindow) -> np.ndarray:
        return np.fmax(beyond(window.voltage, self._lowest, self._highest), 0.0)  # fmax ignores NaN
