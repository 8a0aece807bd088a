"""All sensor checks together: limit of each row, times of comparison, adding a check."""

import math
from typing import Any, ClassVar

import numpy as np
from changed_robots import with_each_motor
from sensor_readings import SAMPLE_US, STILL

from footfall.deploy.modes import Mode
from footfall.deploy.sensor_checks.check import JointCheck, Limit
from footfall.deploy.sensor_checks.joint_window import JointWindow, JointWindows
from footfall.deploy.sensor_checks.monitor import SensorMonitor
from footfall.deploy.sensor_checks.table import JOINT_CHECKS, SensorLimits
from footfall.deploy.signals import Implausible
from footfall.deploy.wiring import wiring_of
from footfall.robots.description import Robot

VELOCITY, TORQUE, TEMPERATURE, VOLTAGE = range(1, 5)  # rows of readings, after positions
CALF = 2  # FR_calf_joint (can0, id 3): 35.55 N m, 20.06 rad/s
WIDE_LIMITS = SensorLimits(drift_rad=6.0, wander_rad=6.0, creep_rad=6.0, stuck_rad=6.0, unexplained=10.0)
ZEROS, NAN = np.zeros(12), np.full((2, 12), math.nan)
NOTHING_SENT = np.zeros((5, 12)), np.zeros((5, 12)), (ZEROS, ZEROS)


def monitor_of(robot: Robot, **checks: object) -> SensorMonitor:
    """A monitor that began with a robot that stands still."""
    monitor = SensorMonitor(robot, wiring_of(robot), WIDE_LIMITS, 0.002, **checks)  # type: ignore[arg-type]
    joints = np.array([robot.default_pose, ZEROS, ZEROS])
    monitor.begin(0, np.zeros(12, np.int64), STILL, joints, robot.default_pose)
    return monitor


def window(
    monitor: SensorMonitor, joints: np.ndarray, number: int = 0, health: Any = NAN
) -> Implausible | None:
    """Finding on the joints in one window of constant readings; `health`: temperatures and voltages."""
    for now_us in SAMPLE_US * np.arange(10 * number + 1, 10 * number + 11):
        full = monitor.add(int(now_us), 0, np.full(12, now_us), STILL, joints, *NOTHING_SENT)
    assert full
    return monitor.joint_contradiction(ZEROS, joints[0], *health)


def found(robot: Robot, row: int = VELOCITY, value: float = 0.0) -> str:
    """Findings for a robot that stands still, with one changed value of one motor."""
    readings = np.array([robot.default_pose, ZEROS, ZEROS, *NAN])
    readings[row, CALF] = value
    implausible = window(monitor_of(robot), readings[:3], health=readings[3:])
    assert implausible is None or implausible.leads_to is Mode.ESTOP
    return "" if implausible is None else implausible.fault


class TestFigures:
    def test_a_motors_limits_bound_its_readings(self, go1: Robot) -> None:
        for row, allowed, beyond, message in (
            (VELOCITY, -1.49 * 20.06, -1.51 * 20.06, "30.3 rad/s"),
            (TORQUE, 1.19 * 35.55, 1.21 * 35.55, "43.0 N m"),
            (TORQUE, -1.19 * 35.55, -1.21 * 35.55, "43.0 N m"),
            (TEMPERATURE, 85.0, 86.0, "86 degrees Celsius"),
        ):
            assert found(go1, row, allowed) == ""
            fault = found(go1, row, beyond)
            assert fault.startswith("FR_calf_joint (can0, id 3)")
            assert message in fault
        assert found(go1, TORQUE, math.nan).startswith("FR_calf_joint")

    def test_a_supply_has_to_be_in_the_motors_range(self, go1: Robot) -> None:
        ranged = with_each_motor(go1, voltage_v=(10.0, 14.8))
        assert found(ranged) == ""  # its voltage and temperature are NaN: not reported
        for voltage, off in ((9.5, "0.5 V"), (10.0, ""), (14.8, ""), (16.8, "2.0 V")):
            fault = found(ranged, VOLTAGE, voltage)
            assert off in fault if off else fault == ""
            assert found(go1, VOLTAGE, voltage) == ""  # without a range


class Twitch(JointCheck):
    """A made-up check: the sum of a joint's speeds."""

    quantity = "how much a joint twitches"
    message = "twitches by {0:.1f} rad/s"
    limit = Limit("speed_share")  # 1.5
    leads_to: ClassVar[Mode] = Mode.FALLING

    def reset(self) -> None:
        self.sum = ZEROS

    def measure(self, window: JointWindow) -> np.ndarray:
        self.sum = self.sum + window.speed
        return self.sum


def test_a_made_up_check_is_judged_and_reset(go1: Robot) -> None:
    moving = np.array([go1.default_pose, ZEROS + 1.0 * (np.arange(12) == CALF), ZEROS])
    monitor = monitor_of(go1, joint_checks=(*JOINT_CHECKS, Twitch))
    assert window(monitor, moving) is None
    twitches = Implausible("FR_calf_joint (can0, id 3): twitches by 2.0 rad/s", Mode.FALLING)
    assert window(monitor, moving, number=1) == twitches
    monitor.begin(20 * SAMPLE_US, np.full(12, 20 * SAMPLE_US), STILL, moving, moving[0])
    assert window(monitor, moving, number=2) is None


def test_a_gap_of_half_or_1_5_periods() -> None:
    for period_s, longest_us in ((0.04, 20_000), (0.004, 6000)):
        for silence_us, compared in ((longest_us, True), (longest_us + 1, False)):
            windows, times_us = JointWindows(12, period_s, 0.002), np.full(12, SAMPLE_US)
            windows.add(SAMPLE_US, silence_us, times_us, STILL, np.zeros((3, 12)), *NOTHING_SENT)
            assert (windows.close(ZEROS, ZEROS, ZEROS, ZEROS) is not None) is compared
