"""Adds up what sensors say, and works out how far they contradict each other.

Readings are summed at each tick and compared every `period_s`, which keeps the cost of a tick small and takes
single spikes out.
"""

import math
from collections.abc import Sequence

import numpy as np

from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.pose import beyond
from footfall.deploy.sensor_limits import SensorLimits
from footfall.robots.description import Robot

GRAVITY = 9.81
IMU_PARTS = Inertial._fields


class SensorMonitor:
    """Adds up readings and looks at them from time to time."""

    def __init__(self, robot: Robot, limits: SensorLimits, tick_s: float) -> None:
        n = len(robot.joint_names)
        self._limits = limits
        self._every = max(1, round(limits.period_s / tick_s))
        self._gap_us = round(1e6 * max(limits.period_s / 2, 1.5 * tick_s))
        self.lower, self.upper = robot.lower_rad, robot.upper_rad
        self._much = limits.torque_much * robot.motor.peak_torque
        self._little = limits.torque_little * robot.motor.peak_torque
        self._n = n
        self._gap, self._added_us = False, 0
        self.begin(0, Inertial((0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0)), np.zeros((3, n)), np.zeros(n))

    def begin(self, now_us: int, inertial: Inertial, joints: np.ndarray, target: np.ndarray) -> None:
        """Forget all, and start from these readings."""
        n = self._n
        self._start_window(now_us)
        self.joints, self._target, self._inertial = joints, target, inertial
        self.temperature = np.zeros(n)
        self.drift, self.repeated = np.zeros(n), np.zeros(n)
        self.limp_s, self.opposing_s = np.zeros(n), np.zeros(n)
        self.rotation = [0.0, 0.0, 0.0]
        self._imu_repeated = [0.0, 0.0, 0.0]
        self._resting_s = 0.0
        self._resting = [0.0, 0.0, 0.0]  # mean acceleration of the rest, world axes
        self.rest_error = 0.0
        self._lean = [0.0, 0.0]

    def add(
        self,
        now_us: int,
        silence_us: int,
        inertial: Inertial,
        joints: np.ndarray,
        commanded: np.ndarray,
        stiffness: np.ndarray,
        target: np.ndarray,
        temperature: np.ndarray,
    ) -> bool:
        """Take in one tick's readings; returns whether it was time to look at them.

        Args:
            now_us: the loop's time.
            silence_us: how old the oldest of the readings is. After a gap they are not compared, since what
                happened in it is not known.
            inertial: the IMU's reading.
            joints: (3, n) position rad, velocity rad/s, torque N m that the motors report.
            commanded: (n,) torque that the last command asked for, N m.
            stiffness: (n,) of the last command, N m/rad.
            target: (n,) position targets that went out last, rad.
            temperature: (n,) degrees Celsius.
        """
        self._readings.append(joints)
        self._commands.append(commanded)
        self._inertials.append(inertial)
        self._ticks += 1
        self._gap |= silence_us > self._gap_us or now_us - self._added_us > self._gap_us
        self._added_us = now_us
        if self._ticks < self._every:
            return False
        compared = not self._gap
        if compared:
            self._compare((now_us - self._looked_us) * 1e-6, inertial, joints, stiffness, target)
        self.temperature = temperature
        self.joints, self._target, self._inertial = joints, target, inertial
        self._start_window(now_us)
        return compared

    def _start_window(self, now_us: int) -> None:
        self._ticks, self._looked_us, self._added_us, self._gap = 0, now_us, now_us, False
        self._readings: list[np.ndarray] = []  # since the last look
        self._commands: list[np.ndarray] = []
        self._inertials: list[Inertial] = []

    def _compare(
        self,
        elapsed_s: float,
        inertial: Inertial,
        joints: np.ndarray,
        stiffness: np.ndarray,
        target: np.ndarray,
    ) -> None:
        limits, count = self._limits, self._ticks
        kept = math.exp(-elapsed_s / limits.memory_s)
        _, velocity, torque = np.add.reduce(self._readings) / count
        commanded = np.add.reduce(self._commands) / count
        gyros, accelerations, _ = zip(*self._inertials, strict=True)
        gyro, acceleration = (
            [sum(values) / count for values in zip(*parts, strict=True)] for parts in (gyros, accelerations)
        )
        moved = joints[0] - self.joints[0]
        self.drift *= kept
        self.drift += moved
        self.drift -= velocity * elapsed_s
        same = (joints == self.joints).all(axis=0)
        self.repeated += np.abs(target - self._target)
        self.repeated *= same
        self._compare_torques(torque, joints[2], commanded, stiffness * velocity, elapsed_s)
        fastest = float(np.maximum.reduce(np.abs(velocity)))
        self._compare_turns(gyro, inertial.quaternion, elapsed_s, kept)
        self._compare_gravity(acceleration, gyro, inertial, fastest, elapsed_s)
        for part, (now, before) in enumerate(zip(inertial, self._inertial, strict=True)):
            if now != before:
                self._imu_repeated[part] = 0.0
            elif fastest > limits.moving_rad_s:
                self._imu_repeated[part] += elapsed_s

    def _compare_torques(
        self,
        torque: np.ndarray,
        last: np.ndarray,
        commanded: np.ndarray,
        slope: np.ndarray,
        elapsed_s: float,
    ) -> None:
        """How long much was commanded, and none, or the opposite, was reported.

        A motor that follows late does either for moments; what it reports in between sets the time back.

        Args:
            torque: reported torque, N m, (n,), on average since the last look.
            last: torque that was reported last.
            commanded: commanded torque, on average since the last look.
            slope: how fast the commanded torque changes with a joint's motion, N m/s. It was worked out
                from older readings than the motor's own, so that some of it counts for nothing.
            elapsed_s: time since the last look.
        """
        asked = np.abs(commanded) - self._limits.lag_s * np.abs(slope) > self._much
        reports = np.maximum(np.abs(torque), np.abs(last)) > self._little
        self.limp_s += elapsed_s * asked
        self.limp_s *= ~reports
        self.opposing_s += elapsed_s * (asked & (np.abs(torque) > self._much))
        self.opposing_s *= ~(reports & (torque * commanded > 0.0))

    def _compare_turns(self, gyro: list[float], now: Sequence[float], elapsed_s: float, kept: float) -> None:
        """The body's turn since the last look: by quaternions twice the vector part of before* now."""
        w, x, y, z = self._inertial.quaternion
        a, b, c, d = now
        sign = 2.0 if w * a + x * b + y * c + z * d >= 0.0 else -2.0
        turn = (
            sign * (w * b - x * a - y * d + z * c),
            sign * (w * c + x * d - y * a - z * b),
            sign * (w * d - x * c + y * b - z * a),
        )
        self.rotation = [
            kept * error + angle - rate * elapsed_s
            for error, angle, rate in zip(self.rotation, turn, gyro, strict=True)
        ]

    def _compare_gravity(
        self, pulled: list[float], gyro: list[float], inertial: Inertial, fastest: float, elapsed_s: float
    ) -> None:
        """Mean acceleration in the world's axes: at rest, and on average, it is gravity's opposite."""
        limits = self._limits
        w, x, y, z = inertial.quaternion
        a, b, c = pulled
        ahead = (1 - 2 * (y * y + z * z)) * a + 2 * (x * y - w * z) * b + 2 * (x * z + w * y) * c
        left = 2 * (x * y + w * z) * a + (1 - 2 * (x * x + z * z)) * b + 2 * (y * z - w * x) * c
        up = 2 * (x * z - w * y) * a + 2 * (y * z + w * x) * b + (1 - 2 * (x * x + y * y)) * c
        kept = math.exp(-elapsed_s / limits.lean_memory_s)
        self._lean = [kept * self._lean[0] + (1 - kept) * ahead, kept * self._lean[1] + (1 - kept) * left]
        if max(fastest, *map(abs, gyro)) >= limits.resting_rad_s:
            self._resting_s, self.rest_error = 0.0, 0.0
            return
        weight = max(elapsed_s / (self._resting_s + elapsed_s), 1.0 - kept)  # a mean, at first of all of it
        self._resting = [
            mean + weight * (value - mean)
            for mean, value in zip(self._resting, (ahead, left, up), strict=True)
        ]
        self._resting_s += elapsed_s
        if self._resting_s >= limits.resting_s:
            ahead, left, up = self._resting
            self.rest_error = math.hypot(ahead, left, up - GRAVITY) / GRAVITY

    # -- what the rows measure -----------------------------------------------------------------------

    def outside(self) -> np.ndarray:
        """How far each joint is beyond its range, rad."""
        return beyond(self.joints[0], self.lower, self.upper)

    def lean(self) -> float:
        """Mean sideways acceleration over gravity."""
        return math.hypot(*self._lean) / GRAVITY

    def imu_repeated(self, part: str) -> float:
        """How long a part of the IMU has repeated itself while joints moved, s."""
        return self._imu_repeated[IMU_PARTS.index(part)]
