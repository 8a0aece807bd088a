"""Sensors checked against each other and against what was commanded: a table of checks.

Each row says what it compares, its limit in `SensorLimits`, and the state that it leads to.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from footfall.deploy.safety import Implausible, Mode
from footfall.deploy.sensor_limits import SensorLimits
from footfall.deploy.sensor_monitor import IMU_PARTS, SensorMonitor
from footfall.deploy.wiring import Wiring
from footfall.robots.description import Robot


class SensorCheck(NamedTuple):
    """One row: what is compared, in a sentence that ends with the figure, and what follows."""

    name: str
    says: str  # of the place and the value
    measure: Callable[["SensorMonitor"], np.ndarray | float]
    limit: str  # field of `SensorLimits`
    leads_to: Mode = Mode.ESTOP


JOINT_CHECKS = (
    SensorCheck(
        "joint position within its range",
        "reads {1:.2f} rad, {0:.2f} rad beyond its range",
        SensorMonitor.outside,
        "position_rad",
    ),
    SensorCheck(
        "joint position against velocity",
        "its position changed by {0:.2f} rad other than its velocity says",
        lambda monitor: monitor.drift,
        "drift_rad",
    ),
    SensorCheck(
        "a motor that is limp",
        "the motor has reported no torque for {0:.2f} s while torque was commanded",
        lambda monitor: monitor.limp_s,
        "limp_s",
    ),
    SensorCheck(
        "a motor that pulls the other way",
        "the motor pulls the other way by {0:.0%} of the torque that was commanded",
        lambda monitor: monitor.opposing,
        "opposing",
    ),
    SensorCheck(
        "joint readings against a moving target",
        "it repeats one reading while its target moved by {0:.2f} rad",
        lambda monitor: monitor.repeated,
        "repeated_rad",
    ),
    SensorCheck(
        "motor temperature",
        "the motor is at {0:.0f} degrees Celsius",
        lambda monitor: monitor.temperature,
        "temperature_c",
    ),
)

BODY_CHECKS = (
    SensorCheck(
        "gyro against quaternion",
        "the IMU: its quaternion turned by {0:.2f} rad other than its gyro says",
        lambda monitor: math.hypot(*monitor.rotation),
        "rotation_rad",
    ),
    *(
        SensorCheck(
            f"{part} that repeats itself",
            f"the IMU: its {part} has repeated itself for {{0:.2f}} s while joints moved",
            lambda monitor, part=part: monitor.imu_repeated(part),  # type: ignore[misc]
            "imu_repeated_s",
        )
        for part in IMU_PARTS
    ),
    SensorCheck(
        "acceleration at rest",
        "the IMU: at rest its acceleration is off its quaternion's gravity by {0:.0%}",
        lambda monitor: monitor.rest_error,
        "rest_error",
    ),
    SensorCheck(
        "acceleration against quaternion",
        "the IMU: its acceleration leans away from its quaternion's gravity by {0:.0%}",
        SensorMonitor.lean,
        "lean_error",
    ),
    SensorCheck(
        "acceleration against gravity",
        "the IMU: on average its acceleration is off gravity by {0:.0%}",
        SensorMonitor.lift,
        "lift_error",
    ),
    SensorCheck(
        "legs that carry the body",
        "the base has sunk to the ground: {0:.0%} of its clearance is gone",
        lambda monitor: monitor.sunk,
        "sunk",
        Mode.FALLING,
    ),
)


class SensorChecks:
    """The checks of one robot."""

    def __init__(self, robot: Robot, wiring: Wiring, limits: SensorLimits, tick_s: float) -> None:
        n = len(robot.joint_names)
        self.monitor = SensorMonitor(robot, limits, tick_s)
        self._places = [wiring.place(joint) for joint in range(n)]
        self._joint_limits = np.array([[getattr(limits, check.limit)] for check in JOINT_CHECKS])
        self._joint_measures = np.zeros((len(JOINT_CHECKS), n))
        self._body_limits = tuple(getattr(limits, check.limit) for check in BODY_CHECKS)

    def find(self) -> Implausible | None:
        """The first contradiction that goes too far, if there is one."""
        monitor, measures = self.monitor, self._joint_measures
        for row, check in enumerate(JOINT_CHECKS):
            measures[row] = check.measure(monitor)
        good = measures <= self._joint_limits  # what is no number is not good either
        if np.count_nonzero(good) < good.size:
            row, joint = np.argwhere(~good)[0].tolist()
            check = JOINT_CHECKS[row]
            says = check.says.format(measures[row, joint], monitor.joints[0, joint])
            return Implausible(f"{self._places[joint]}: {says}", check.leads_to)
        for check, limit in zip(BODY_CHECKS, self._body_limits, strict=True):
            value = check.measure(monitor)
            if not value <= limit:
                return Implausible(check.says.format(value), check.leads_to)
        return None
