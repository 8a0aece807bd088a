"""Sums of joint readings over a window.

Readings are added every `SAMPLE_S` and compared every `period_s`: this keeps a tick cheap and suppresses
single spikes.
"""

from typing import NamedTuple

import numpy as np

from footfall.deploy.drivers.imu import Inertial

SAMPLE_S = 0.004  # interval of added readings: a fraction of a leg's swing


class JointWindow(NamedTuple):
    """Readings of n joints and their commands, between two comparisons. All arrays are (n,)."""

    elapsed_s: float
    joints: np.ndarray  # (3, n) last reading: position rad, velocity rad/s, torque N m
    repeated: np.ndarray  # (3, n) whether each reading of the window equals the previous one
    travel: np.ndarray  # rad, integral of the velocities
    position_error: np.ndarray  # rad, change of the position minus the travel
    late_s: np.ndarray  # difference between the ages of the oldest and the youngest reading
    speed: np.ndarray  # mean, rad/s
    jolts: np.ndarray  # sum of the absolute second differences of the velocity readings, rad/s
    torque: np.ndarray  # mean of the reported torque, N m
    strongest: np.ndarray  # largest absolute reported torque, N m
    expected: np.ndarray  # mean expected torque from the last commands, N m
    stiffness: np.ndarray  # of the last command, N m/rad
    target_speed: np.ndarray  # speed of the position target, rad/s
    target_travel: np.ndarray  # travel of the position target in the previous window, rad
    mean: np.ndarray  # (3, n) mean of the readings, rows as in `joints`
    commanded_mean: np.ndarray  # mean torque from the last command at each reading, N m
    gains: np.ndarray  # (2, n) stiffness and damping of the last command, N m/rad, N m s/rad
    torques: np.ndarray  # (k, n) each reported torque, N m
    commanded: np.ndarray  # (2, k, n) smallest and negated largest torque commanded before each report, N m
    temperature_c: np.ndarray  # NaN if not reported
    voltage: np.ndarray  # supply voltage of the motors, V; NaN if not reported


def single_reading(joints: np.ndarray, temperature_c: np.ndarray, voltage: np.ndarray) -> JointWindow:
    """A window of one reading, for the checks that need only one."""
    none = np.zeros(joints.shape[1])
    return JointWindow(
        0.0,
        joints,
        np.zeros(joints.shape, bool),
        *(none,) * 11,
        np.zeros(joints.shape),
        none,
        np.zeros((2, len(none))),
        none[None],
        np.zeros((2, 1, joints.shape[1])),
        temperature_c,
        voltage,
    )


class _Sums:
    """Sums since the start of a window."""

    def __init__(self, n: int, now_us: int) -> None:
        self.began_us = now_us
        self.gap = False
        self.readings = np.zeros((3, n))
        self.repeated = np.ones((3, n), bool)
        self.strongest = np.zeros(n)
        self.torques: list[np.ndarray] = []
        self.smallest: list[np.ndarray] = []  # smallest commanded torque, and minus the largest
        self.minus_largest: list[np.ndarray] = []
        self.expected, self.commanded_sum = np.zeros((2, n))
        self.gains = np.zeros((2, n))
        self.travel, self.jolts = np.zeros((2, n))
        self.starts = np.zeros(n)  # positions at the start of the window, computed from each reading, rad
        self.late_us = np.zeros(n)
        self.inertials: list[Inertial] = []


class JointWindows:
    """Adds readings until a window is full."""

    def __init__(self, joints: int, period_s: float, tick_s: float) -> None:
        """Windows of `joints` joints that last `period_s` at ticks of `tick_s`."""
        self._n = joints
        self.sample_s = tick_s * max(1, round(min(SAMPLE_S, period_s) / tick_s))
        self._sample_us = round(1e6 * (self.sample_s - tick_s / 2))  # half a tick early, because of rounding
        self._readings = max(1, round(period_s / self.sample_s))  # number per window
        self._gap_us = round(1e6 * max(period_s / 2, 1.5 * self.sample_s))
        self.begin(0, np.zeros(joints, np.int64), np.zeros((3, joints)), np.zeros(joints))

    def begin(self, now_us: int, arrived_us: np.ndarray, joints: np.ndarray, target: np.ndarray) -> None:
        """Clear all readings, and start with these (see `add`) and these position targets, rad, (n,)."""
        self._sums = _Sums(self._n, now_us)
        self._added_us = now_us
        self._arrived_us = arrived_us.copy()
        self._last, self._target = joints, target
        self._change = np.zeros(self._n)  # change of the velocities between readings, rad/s
        self._target_travel = np.zeros(self._n)
        self._ended = joints[0]  # positions at the end of the last window, rad
        self._youngest_us = (now_us - arrived_us).astype(float)  # smallest age of each motor's readings

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
        expected: np.ndarray,
        commanded: tuple[np.ndarray, np.ndarray] | None = None,
        sent: np.ndarray | None = None,
    ) -> bool:
        """Add one tick's readings; returns whether the window is full.

        Args:
            now_us: time of the loop.
            silence_us: age of the oldest reading. A window with a gap is not used, because the motion in the
                gap is unknown.
            arrived_us: (n,) arrival time of each motor's reading.
            inertial: reading of the IMU.
            joints: (3, n) reported position rad, velocity rad/s, torque N m.
            expected: (n,) expected torque from the last commands for these readings, N m.
            commanded: smallest torque of all commands since the last call, and minus the largest, N m,
                (n,) each; None for `expected`.
            sent: (5, n) last command, rows as in `JointCommand`; None if unknown.
        """
        sums, last = self._sums, self._last
        if silence_us > self._gap_us or now_us - self._added_us > self._gap_us:
            sums.gap = True
        age_us = now_us - arrived_us
        np.minimum(self._youngest_us, age_us, out=self._youngest_us)
        np.maximum(sums.late_us, age_us - self._youngest_us, out=sums.late_us)
        self._added_us = now_us
        sums.travel += (0.5e-6 * (arrived_us - self._arrived_us)) * (joints[1] + last[1])
        sums.starts += joints[0] - sums.travel
        self._arrived_us = arrived_us.copy()
        change = joints[1] - last[1]
        sums.jolts += np.abs(change - self._change)
        self._change = change
        sums.repeated &= joints == last
        self._last = joints
        sums.readings += joints
        np.maximum(sums.strongest, np.abs(joints[2]), out=sums.strongest)
        sums.torques.append(joints[2])
        smallest, minus_largest = commanded or (expected, -expected)
        sums.smallest.append(smallest)
        sums.minus_largest.append(minus_largest)
        sums.expected += expected
        if sent is not None:
            sums.gains = sent[2:4]
            sums.commanded_sum += (sums.gains * (sent[:2] - joints[:2])).sum(axis=0) + sent[4]
        sums.inertials.append(inertial)
        return len(sums.inertials) >= self._readings

    @property
    def inertials(self) -> list[Inertial]:
        """Readings of the IMU in the current window."""
        return self._sums.inertials

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
        window = None
        if self._sums.gap:
            self._ended = self._last[0]
        else:
            window = self._window(stiffness, target, temperature_c, voltage)
        self._target_travel = np.abs(target - self._target)
        self._target = target
        self._sums = _Sums(self._n, self._added_us)
        return window

    def _window(
        self, stiffness: np.ndarray, target: np.ndarray, temperature_c: np.ndarray, voltage: np.ndarray
    ) -> JointWindow:
        sums, count = self._sums, len(self._sums.inertials)
        elapsed_s = (self._added_us - sums.began_us) * 1e-6
        mean = sums.readings / count
        _, velocity, torque = mean
        # Each position minus the travel until then gives the start of the window. The mean has less noise.
        started = sums.starts / count
        position_error = started - self._ended
        self._ended = started + sums.travel
        return JointWindow(
            elapsed_s=elapsed_s,
            joints=self._last,
            repeated=sums.repeated,
            travel=sums.travel,
            position_error=position_error,
            late_s=1e-6 * sums.late_us,
            speed=np.abs(velocity),
            jolts=sums.jolts,
            torque=torque,
            strongest=sums.strongest,
            expected=sums.expected / count,
            stiffness=stiffness,
            target_speed=np.abs(target - self._target) / elapsed_s,
            target_travel=self._target_travel,
            mean=mean,
            commanded_mean=sums.commanded_sum / count,
            gains=sums.gains,
            torques=np.array(sums.torques),
            commanded=np.array((*sums.smallest, *sums.minus_largest)).reshape(2, count, -1),
            temperature_c=temperature_c,
            voltage=voltage,
        )
