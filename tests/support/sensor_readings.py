"""Invented readings for the sensor checks, and the value that each check measures."""

from collections.abc import Callable
from typing import Any

import numpy as np

from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.sensor_checks.body_window import BodyReadings, body_window
from footfall.deploy.sensor_checks.check import BodyCheck, JointCheck
from footfall.deploy.sensor_checks.joint_window import JointWindows
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.robots.description import Robot

LIMITS = SensorLimits()
STILL = Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (1.0, 0.0, 0.0, 0.0))
SAMPLE_US = 4000
PER_WINDOW = 10
SWING_RAD, SWING_RAD_S = 0.1, 15.0  # of a leg: 2.4 swings a second

Reading = Callable[[float], tuple[float, float]]  # s to rad and rad/s


def swing(time_s: float) -> tuple[float, float]:
    """A joint that swings to and fro."""
    angle = SWING_RAD_S * time_s
    return SWING_RAD * np.sin(angle), SWING_RAD * SWING_RAD_S * np.cos(angle)


class JointReadings:
    """Feeds a robot's joint readings to some checks, window by window."""

    def __init__(self, robot: Robot, *checks: type[JointCheck], limits: SensorLimits = LIMITS) -> None:
        self.n = len(robot.joint_names)
        self.windows = JointWindows(self.n, limits, 0.002)
        self.checks = [check(robot, limits, self.windows.sample_s) for check in checks]
        self.values = np.zeros((len(checks), self.n))  # of the last window
        self.zeros = np.zeros(self.n)

    def begin(self, now_us: int, arrived_us: np.ndarray, joints: np.ndarray) -> None:
        self.windows.begin(now_us, arrived_us, joints, self.zeros)

    def add(
        self,
        now_us: int,
        joints: np.ndarray,
        arrived_us: Any = None,
        expected: Any = 0.0,
        stiffness: float = 0.0,
        target: float = 0.0,
        sent: np.ndarray | None = None,
    ) -> bool:
        """Add one reading; returns whether a window has ended and was passed to the checks."""
        arrived_us = np.full(self.n, now_us) if arrived_us is None else arrived_us
        expected = self.zeros + expected
        if sent is None:
            sent = np.zeros((5, self.n))
            sent[4] = expected
        if not self.windows.add(now_us, 0, arrived_us, STILL, joints, sent, sent, [expected]):
            return False
        zeros = self.zeros
        window = self.windows.close(zeros + stiffness, zeros + target, zeros, zeros)
        assert window is not None
        self.values = np.array([check.measure(window) for check in self.checks])
        return True


def measured(
    robot: Robot,
    check: type[JointCheck],
    reading: Reading = swing,
    torque: Callable[[float], tuple[float, float]] = lambda _: (0.0, 0.0),
    samples: int = 250,
    stiffness: float = 0.0,
    target: Callable[[float], float] = lambda _: 0.0,
) -> np.ndarray:
    """Final value of a check for a robot whose joint 0 moves, (n,).

    `torque` gives the reported and the expected torque of that joint, as shares of its peak torque.
    """
    result = JointReadings(robot, check)
    joints = np.zeros((3, result.n))
    joints[:2, 0] = reading(0.0)
    result.begin(0, np.zeros(result.n, np.int64), joints)
    for k in range(1, samples + 1):
        time_s = k * SAMPLE_US * 1e-6
        joints, expected = joints.copy(), result.zeros.copy()
        joints[:2, 0] = reading(time_s)
        joints[2, 0], expected[0] = robot.motor.peak_torque[0] * np.array(torque(time_s))
        result.add(k * SAMPLE_US, joints, None, expected, stiffness, target(time_s))
    return result.values[0]


class BodyWindows:
    """Feeds windows of IMU readings to one check of the base."""

    def __init__(self, robot: Robot, check: type[BodyCheck], before: Inertial = STILL) -> None:
        self.check = check(robot, LIMITS, SAMPLE_US * 1e-6)
        self.before, self._position = before, robot.default_pose

    def update(self, *inertials: Inertial, speed_rad_s: float = 0.0) -> float:
        """Value of the check after one more window of 40 ms on the robot's legs."""
        readings = BodyReadings(0.04, self.before, list(inertials), self._position, np.zeros(12), speed_rad_s)
        self.before = inertials[-1]
        return self.check.measure(body_window(readings, True))
