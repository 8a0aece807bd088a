"""Sensors checked against each other, against what was commanded and what the robot bears: a table of rules.

Each row says what it looks at, its limit, and the state that it leads to.
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

Values = np.ndarray | float  # one for each joint, or one for the body


class Limit(NamedTuple):
    """How large what is measured may be: a setting, a motor's figure, or a share of one."""

    setting: str = ""  # field of `SensorLimits`
    motor: str = ""  # field of `MotorType` in robot.yaml

    def of(self, robot: Robot, limits: SensorLimits) -> Values:
        share = getattr(limits, self.setting) if self.setting else 1.0
        return share * robot.motor_figures(self.motor) if self.motor else share


class SensorCheck(NamedTuple):
    """One row: what is compared, in a sentence that ends with the figure, and what follows."""

    looks_at: str
    says: str  # of the place and the value
    measure: Callable[["SensorMonitor"], Values]
    limit: Limit
    leads_to: Mode = Mode.ESTOP


JOINT_CHECKS = (
    SensorCheck(
        "a joint's position beyond its range in the MJCF",
        "reads {1:.2f} rad, {0:.2f} rad beyond its range",
        SensorMonitor.outside,
        Limit("position_rad"),
    ),
    SensorCheck(
        "a joint's velocity",
        "turns at {0:.1f} rad/s, faster than its motor can",
        lambda monitor: np.abs(monitor.joints[1]),
        Limit("speed_share", "no_load_speed_rad_s"),
    ),
    SensorCheck(
        "a motor's reported torque",
        "the motor reports {0:.1f} N m, more than it can",
        lambda monitor: np.abs(monitor.joints[2]),
        Limit("torque_share", "peak_torque_nm"),
    ),
    SensorCheck(
        "a joint's way by its position against that by its velocity: stuck, jumping, swapped encoders",
        "its position changed by {0:.2f} rad other than its velocity says",
        lambda monitor: monitor.drift,
        Limit("drift_rad"),
    ),
    SensorCheck(
        "the same on the whole: an encoder that drifts",
        "its position has wandered by {0:.2f} rad other than its velocity says",
        lambda monitor: monitor.wander,
        Limit("wander_rad"),
    ),
    SensorCheck(
        "the same of a joint whose position or velocity repeats itself: an encoder that is stuck",
        "its position or velocity repeats itself, {0:.3f} rad other than the other one says",
        lambda monitor: monitor.stuck,
        Limit("stuck_rad"),
    ),
    SensorCheck(
        "how long a motor reports no torque while much is commanded: it has rebooted",
        "the motor has reported no torque for {0:.2f} s while torque was commanded",
        lambda monitor: monitor.limp_s,
        Limit("limp_s"),
    ),
    SensorCheck(
        "how much of its torque a motor pulls the other way",
        "the motor pulls the other way by {0:.0%} of the torque that was commanded",
        lambda monitor: monitor.opposing,
        Limit("opposing"),
    ),
    SensorCheck(
        "how far the torque that is asked of a motor moves while it repeats one report: stuck, or rebooted",
        "the motor repeats one torque, as one that has rebooted, while what is asked of it moved by {0:.0%}",
        lambda monitor: monitor.torque_stuck,
        Limit("torque_stuck"),
    ),
    SensorCheck(
        "how far a target moves while its motor repeats one reply",
        "it repeats one reading while its target moved by {0:.2f} rad",
        lambda monitor: monitor.repeated,
        Limit("repeated_rad"),
    ),
    SensorCheck(
        "a motor's temperature, where it tells",
        "the motor is at {0:.0f} degrees Celsius",
        SensorMonitor.hot,
        Limit(motor="temperature_limit_c"),
    ),
    SensorCheck(
        "a motor's voltage beyond `voltage_v` in robot.yaml, where it tells",
        "the motor's supply is {0:.1f} V outside its range",
        SensorMonitor.off_voltage,
        Limit("voltage_v"),
    ),
)

BODY_CHECKS = (
    SensorCheck(
        "the quaternion's turn against the gyro's",
        "the IMU: its quaternion turned by {0:.2f} rad other than its gyro says",
        lambda monitor: math.hypot(*monitor.rotation),
        Limit("rotation_rad"),
    ),
    *(
        SensorCheck(
            f"how long the {part} repeats itself while joints move",
            f"the IMU: its {part} has repeated itself for {{0:.2f}} s while joints moved",
            lambda monitor, part=part: monitor.imu_repeated(part),  # type: ignore[misc]
            Limit("imu_repeated_s"),
        )
        for part in IMU_PARTS
    ),
    SensorCheck(
        "acceleration at rest against the quaternion's gravity: an IMU askew by 9 degrees",
        "the IMU: at rest its acceleration is off its quaternion's gravity by {0:.0%}",
        lambda monitor: monitor.rest_error,
        Limit("rest_error"),
    ),
    SensorCheck(
        "acceleration in motion against it, on average, sideways",
        "the IMU: its acceleration leans away from its quaternion's gravity by {0:.0%}",
        SensorMonitor.lean,
        Limit("lean_error"),
    ),
    SensorCheck(
        "the same upwards: an accelerometer with another unit or sign",
        "the IMU: on average its acceleration is off gravity by {0:.0%}",
        SensorMonitor.lift,
        Limit("lift_error"),
    ),
    SensorCheck(
        "the IMU's level against the plane of the feet that stand: an IMU or a leg's encoders are off",
        "the IMU: the base is tilted by {0:.2f} rad other than the legs that stand say",
        SensorMonitor.slope,
        Limit("slope_rad"),
    ),
    SensorCheck(
        "the base's turn by the IMU against that by the legs that stand, whatever the slope",
        "the IMU: the base turned by {0:.2f} rad other than the legs that stand say",
        SensorMonitor.leg_turn,
        Limit("leg_turn_rad"),
    ),
    SensorCheck(
        "the base's clearance that is gone, by legs and IMU: it goes down without tipping over",
        "the base has sunk: {0:.0%} of its clearance is gone",
        lambda monitor: monitor.sunk,
        Limit("sunk"),
        Mode.FALLING,
    ),
)


class SensorChecks:
    """The checks of one robot."""

    def __init__(self, robot: Robot, wiring: Wiring, limits: SensorLimits, tick_s: float) -> None:
        n = len(robot.joint_names)
        self.monitor = SensorMonitor(robot, limits, tick_s)
        self._places = [wiring.place(joint) for joint in range(n)]
        self._joint_limits = np.array(
            [np.broadcast_to(check.limit.of(robot, limits), n) for check in JOINT_CHECKS]
        )
        self._joint_measures = np.zeros((len(JOINT_CHECKS), n))
        self._body_limits = tuple(check.limit.of(robot, limits) for check in BODY_CHECKS)

    def of_joints(self) -> Implausible | None:
        """The first contradiction in what is said of the joints that goes too far, if there is one."""
        monitor, measures = self.monitor, self._joint_measures
        for row, check in enumerate(JOINT_CHECKS):
            measures[row] = check.measure(monitor)
        good = measures <= self._joint_limits  # what is no number is not good either
        if np.count_nonzero(good) < good.size:
            row, joint = np.argwhere(~good)[0].tolist()
            check = JOINT_CHECKS[row]
            says = check.says.format(measures[row, joint], monitor.joints[0, joint])
            return Implausible(f"{self._places[joint]}: {says}", check.leads_to)
        return None

    def of_body(self) -> Implausible | None:
        """The same of what is said of the body."""
        for check, limit in zip(BODY_CHECKS, self._body_limits, strict=True):
            value = check.measure(self.monitor)
            if not value <= limit:
                return Implausible(check.says.format(value), check.leads_to)
        return None
