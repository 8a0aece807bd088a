"""Sums of joint readings over a window.

Readings are added every `SAMPLE_S` and compared every `period_s`: this keeps a tick cheap and suppresses
single spikes.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from footfall.common.arrays import any_nonzero, clamped
from footfall.deploy.drivers.imu import Inertial
from footfall.robots.actuator import JointCommand, pd_torque

SAMPLE_S = 0.004  # interval of added readings: a fraction of a leg's swing
_ZERO = np.zeros(())


class WindowLimits(Protocol):
    """The part of `SensorLimits` that several checks of joints share."""

    @property
    def period_s(self) -> float: ...
    @property
    def drift_memory_s(self) -> float: ...
    @property
    def filter_s(self) -> float: ...
    @property
    def reading_rad(self) -> float: ...
    @property
    def lag_s(self) -> float: ...


class JointWindow(NamedTuple):
    """Readings of n joints and their commands, between two comparisons. All arrays are (n,)."""

    elapsed_s: float
    joints: np.ndarray  # (3, n) last reading: position rad, velocity rad/s, torque N m
    repeated: np.ndarray  # (3, n) whether each reading of the window equals the previous one
    any_repeated: bool  # whether any does; if not, the checks of repeated readings do nothing
    travel: np.ndarray  # rad, integral of the velocities
    position_error: np.ndarray  # rad, change of the position minus the travel
    late_s: np.ndarray  # difference between the ages of the oldest and the youngest reading
    late_travel: np.ndarray  # rad, largest effect of late velocities on the travel; decays
    speed: np.ndarray  # mean, rad/s
    jolts: np.ndarray  # sum of the absolute second differences of the velocity readings, rad/s
    torque: np.ndarray  # mean of the reported torque, N m
    strongest: np.ndarray  # largest absolute reported torque, N m
    expected: np.ndarray  # mean expected torque from the last commands, N m
    uncertainty: np.ndarray  # N m, effect of a reading's error on the expected torque
    certain: np.ndarray  # absolute expected torque beyond this uncertainty, N m
    stiffness: np.ndarray  # of the last command, N m/rad
    target_speed: np.ndarray  # speed of the position target, rad/s
    target_travel: np.ndarray  # travel of the position target in the previous window, rad
    mean: np.ndarray  # (3, n) mean of the readings, rows as in `joints`
    commanded_mean: np.ndarray  # mean torque from the last command at each reading, N m
    gains: np.ndarray  # (2, n) stiffness and damping of the last command, N m/rad, N m s/rad
    torques: np.ndarray  # (k, n) each reported torque, N m
    commanded: np.ndarray  # (m, n) each torque commanded between these reports, N m
    first_commanded: list[int]  # (k,) row in `commanded` of the first command after the previous report
    temperature_c: np.ndarray  # NaN if not reported
    voltage: np.ndarray  # supply voltage of the motors, V; NaN if not reported


def single_reading(joints: np.ndarray, temperature_c: np.ndarray, voltage: np.ndarray) -> JointWindow:
    """A window of one reading, for the checks that need only one."""
    none = np.zeros(joints.shape[1])
    return JointWindow(
        0.0,
        joints,
        np.zeros(joints.shape, bool),
        False,
        *(none,) * 14,
        np.zeros(joints.shape),
        none,
        np.zeros((2, len(none))),
        none[None],
        none[None],
        [0],
        temperature_c,
        voltage,
    )


class _Readings:
    """Readings since the start of a window: one entry each time."""

    def __init__(self, now_us: int, joints: np.ndarray, arrived_us: np.ndarray) -> None:
        """`joints` and `arrived_us` are those of the last reading before the window."""
        self.began_us = now_us
        self.gap = False
        self.added_us: list[int] = []
        self.joints, self.arrived_us = [joints], [arrived_us]
        self.commanded: list[np.ndarray] = []  # torques of all commands
        self.first_commanded: list[int] = []  # index of the first of them for each reading
        self.sent: list[np.ndarray] = []  # last command at each reading, and the one before
        self.sent_before: list[np.ndarray] = []
        self.inertials: list[Inertial] = []


class JointWindows:
    """Adds readings until a window is full."""

    def __init__(self, joints: int, limits: WindowLimits, tick_s: float) -> None:
        """Windows of `joints` joints that last `limits.period_s` at ticks of `tick_s`."""
        self._n, self._limits = joints, limits
        period_s = limits.period_s
        self.sample_s = tick_s * max(1, round(min(SAMPLE_S, period_s) / tick_s))
        self._sample_us = round(1e6 * (self.sample_s - tick_s / 2))  # half a tick early, because of rounding
        self._count = max(1, round(period_s / self.sample_s))  # number of readings per window
        self._gap_us = round(1e6 * max(period_s / 2, 1.5 * self.sample_s))
        self._lag_s = limits.filter_s + self.sample_s / 2  # of a velocity with a jump between two readings
        self.begin(0, np.zeros(joints, np.int64), np.zeros((3, joints)), np.zeros(joints))

    def begin(self, now_us: int, arrived_us: np.ndarray, joints: np.ndarray, target: np.ndarray) -> None:
        """Clear all readings, and start with these (see `add`) and these position targets, rad, (n,)."""
        self._readings = _Readings(now_us, joints, arrived_us.copy())
        self._added_us = now_us
        self._target = target
        self._change = np.zeros(self._n)  # change of the velocities between readings, rad/s
        self._target_travel = np.zeros(self._n)
        self._end_position = joints[0]  # positions at the end of the last window, rad
        self._youngest_us = now_us - arrived_us  # smallest age of each motor's readings
        self._late_s, self._fastest = np.zeros((2, self._n))  # s, and rad/s; both decay

    def due(self, now_us: int) -> bool:
        """Whether the next readings are due."""
        return now_us - self._added_us >= self._sample_us

    def add(
        self,
        now_us: int,
        silence_us: int,
        arrived_us: np.ndarray,
        inertial: Inertial,
        joints: np.ndarray,
        sent: np.ndarray,
        sent_before: np.ndarray,
        commanded: Sequence[np.ndarray],
    ) -> bool:
        """Add one tick's readings; returns whether the window is full.

        Args:
            now_us: time of the loop.
            silence_us: age of the oldest reading. A window with a gap is not used, because the motion in the
                gap is unknown.
            arrived_us: (n,) arrival time of each motor's reading.
            inertial: reading of the IMU.
            joints: (3, n) reported position rad, velocity rad/s, torque N m.
            sent: (5, n) last command, rows as in `JointCommand`.
            sent_before: (5, n) the command before.
            commanded: torques of all commands since the last call, at least one, N m, (n,) each.
        """
        readings = self._readings
        if silence_us > self._gap_us or now_us - self._added_us > self._gap_us:
            readings.gap = True
        self._added_us = now_us
        readings.added_us.append(now_us)
        readings.arrived_us.append(arrived_us.copy())
        readings.joints.append(joints)
        readings.first_commanded.append(len(readings.commanded))
        readings.commanded += commanded
        readings.sent.append(sent)
        readings.sent_before.append(sent_before)
        readings.inertials.append(inertial)
        return len(readings.inertials) >= self._count

    @property
    def inertials(self) -> list[Inertial]:
        """Readings of the IMU in the current window."""
        return self._readings.inertials

    def close(
        self, stiffness: np.ndarray, target: np.ndarray, temperature_c: np.ndarray, voltage: np.ndarray
    ) -> JointWindow | None:
        """End the window and begin the next one; returns None if a gap makes the window worthless.

        Args:
            stiffness: (n,) stiffness of the last command, N m/rad.
            target: (n,) last position targets, rad.
            temperature_c: (n,) degrees Celsius; NaN if not reported.
            voltage: (n,) supply voltage of the motors, V; NaN if not reported.
        """
        readings, target_travel, window = self._readings, np.abs(target - self._target), None
        if readings.gap:
            self._end_position = readings.joints[-1][0]
            self._change = readings.joints[-1][1] - readings.joints[-2][1]
        else:
            window = self._window(stiffness, target_travel, temperature_c, voltage)
        self._target_travel, self._target = target_travel, target
        self._readings = _Readings(self._added_us, readings.joints[-1], readings.arrived_us[-1])
        return window

    def _window(
        self, stiffness: np.ndarray, target_travel: np.ndarray, temperature_c: np.ndarray, voltage: np.ndarray
    ) -> JointWindow:
        readings, limits = self._readings, self._limits
        joints, arrived_us = np.array(readings.joints), np.array(readings.arrived_us)
        new, velocity, count = joints[1:], joints[:, 1], len(joints) - 1
        elapsed_s = (self._added_us - readings.began_us) * 1e-6
        half_s = 0.5e-6 * (arrived_us[1:] - arrived_us[:-1])
        travel = np.add.accumulate(half_s * (velocity[1:] + velocity[:-1]))
        mean = np.add.reduce(new) / count
        # Each position minus the travel until then gives the start of the window. The mean has less noise.
        started = mean[0] - np.add.reduce(travel) / count
        position_error = started - self._end_position
        self._end_position = started + travel[-1]
        torques = _torques(readings.sent_before + readings.sent, new)
        expected = np.add.reduce(_expected(torques)) / count
        speed, late_s = np.abs(mean[1]), 1e-6 * self._late_us(arrived_us[1:])
        uncertainty = stiffness * (limits.reading_rad + limits.lag_s * speed)
        repeated = np.logical_and.reduce(new == joints[:-1])
        return JointWindow(
            elapsed_s=elapsed_s,
            joints=readings.joints[-1],
            repeated=repeated,
            any_repeated=any_nonzero(repeated),
            travel=travel[-1],
            position_error=position_error,
            late_s=late_s,
            late_travel=self._late_travel(elapsed_s, late_s, np.abs(joints[-1, 1])),
            speed=speed,
            jolts=self._jolts(velocity),
            torque=mean[2],
            strongest=np.maximum.reduce(np.abs(new[:, 2])),
            expected=expected,
            uncertainty=uncertainty,
            certain=np.maximum(np.abs(expected) - uncertainty, 0.0),
            stiffness=stiffness,
            target_speed=target_travel / elapsed_s,
            target_travel=self._target_travel,
            mean=mean,
            commanded_mean=np.add.reduce(torques[1]) / count,
            gains=readings.sent[-1][2:4],
            torques=new[:, 2],
            commanded=np.array(readings.commanded),
            first_commanded=readings.first_commanded,
            temperature_c=temperature_c,
            voltage=voltage,
        )

    def _late_us(self, arrived_us: np.ndarray) -> np.ndarray:
        """Difference between the ages of the oldest reading of a window and the youngest one so far, (n,)."""
        age_us = np.array(self._readings.added_us)[:, None] - arrived_us
        youngest_us = np.minimum(np.minimum.accumulate(age_us), self._youngest_us)
        self._youngest_us = youngest_us[-1]
        return np.maximum.reduce(age_us - youngest_us)

    def _late_travel(self, elapsed_s: float, late_s: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """`JointWindow.late_travel`, for speeds (n,) at the end of the window, rad/s."""
        kept = math.exp(-elapsed_s / self._limits.drift_memory_s)  # late readings have arrived since then
        self._late_s = kept * self._late_s + late_s
        self._fastest = np.maximum(kept * self._fastest, speed)
        return (self._lag_s + self._late_s) * self._fastest

    def _jolts(self, velocity: np.ndarray) -> np.ndarray:
        """Sum of the second differences of velocities (k, n), without their signs, (n,)."""
        changes = np.concatenate((self._change[None], velocity[1:] - velocity[:-1]))
        self._change = changes[-1]
        return np.add.reduce(np.abs(changes[1:] - changes[:-1]))


def _torques(commands: list[np.ndarray], readings: np.ndarray) -> np.ndarray:
    """Torques at readings (k, 3, n) of 2 k commands (5, n), two for each reading, N m, (2, k, n)."""
    count, _, n = readings.shape
    of_readings = np.array(commands).reshape(2, count, 5, n)
    position, velocity = readings[:, 0], readings[:, 1]
    return pd_torque(JointCommand.of(of_readings.transpose(2, 0, 1, 3)), position, velocity)


def _expected(torques: np.ndarray) -> np.ndarray:
    """Expected torque in each reading, N m, (k, n), from the torques of the last two commands, (2, k, n).

    A reply to a command was measured before the command acts, another kind of message afterwards: so this
    is the smaller torque of the two commands, and 0 if their signs differ.
    """
    return clamped(_ZERO, np.minimum(*torques), np.maximum(*torques))
