"""Checks of single torque reports against the commands of the last moments.

A motor reports the torque for a command and a position that are a few ticks old. The report lies between the
smallest and the largest torque of the last commands. Otherwise bits were flipped, another host sends
commands, or the motor missed a command or has no current.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from footfall.common.arrays import any_nonzero
from footfall.common.config import require_between
from footfall.deploy.sensor_checks.check import JointCheck, Limit
from footfall.deploy.sensor_checks.joint_window import JointWindow
from footfall.deploy.sensor_checks.torque import TorqueLimits
from footfall.robots.description import Robot

WINDOWS_PER_SHARE = 2  # a motor that ignores commands does so for long, and this check is slow


@dataclass(frozen=True)
class UnexplainedLimits:
    """Limits of torque that no command explains."""

    unexplained: float = 0.0035  # of the peak torque: mean that no command explains
    unexplained_memory_s: float = 1.0  # time constant of that mean
    explained_s: float = 0.05  # largest age of a command that explains a report
    strength_share: float = 0.55  # of its torque that a motor may lack: a robot walks with half
    commands_ignored: float = 0.9  # share of the commands' changes that a motor does not follow
    commands_ignored_s: float = 0.6  # time for that share: above a gait's step, as commands may repeat

    def __post_init__(self) -> None:
        require_between(self, 0.001, 10.0, "unexplained")
        require_between(self, 0.01, 60.0, "unexplained_memory_s", "explained_s", "commands_ignored_s")
        require_between(self, 0.0, 1.0, "strength_share", "commands_ignored")


class Limits(UnexplainedLimits, TorqueLimits):
    """Settings of these checks."""


class Unexplained(JointCheck):
    """Mean reported torque beyond all commands of the last `explained_s`.

    Relative to the peak torque. The effect of stiffness on a late or rounded position is subtracted.
    """

    quantity = "mean torque outside the range that recent commands explain"
    message = (
        "its torque is off its commands by {0:.1%} of the peak on average: it misses commands,"
        " gets corrupted ones, or drops out"
    )
    limit = Limit("unexplained")

    def __init__(self, robot: Robot, limits: Limits, sample_s: float) -> None:
        self._n, self._limits, self._peak = len(robot.joint_names), limits, robot.motor.peak_torque
        self._hidden = limits.torque_hidden * self._peak
        self._samples = 1 + math.ceil(limits.explained_s / sample_s)  # number of ranges that explain a report
        self.reset()

    def reset(self) -> None:
        self._value = np.zeros(self._n)
        self._windows = deque[JointWindow](maxlen=self._samples)

    def measure(self, window: JointWindow) -> np.ndarray:
        kept = math.exp(-window.elapsed_s / self._limits.unexplained_memory_s)
        self._value = kept * self._value
        self._windows.append(window)
        tolerance = self._hidden + window.uncertainty
        # Nearly every report is close to one command. Then the ranges, which take longer, are not needed.
        if any_nonzero(np.abs(window.torques - window.commanded[window.first_commanded]) > tolerance):
            beyond = np.maximum(self._beyond(window.torques) - tolerance, 0.0)
            self._value += (1.0 - kept) * beyond.mean(axis=0) / self._peak
        return self._value

    def _beyond(self, torques: np.ndarray) -> np.ndarray:
        """Torque of each report (k, n) beyond the explained range, N m, (k, n); negative if explained."""
        columns = self._samples - 1 + len(torques)
        ranges = _ranges(self._windows[-1])
        for window in list(self._windows)[-2::-1]:
            if ranges.shape[1] >= columns:
                break
            ranges = np.concatenate((_ranges(window), ranges), axis=1)
        missing = max(columns - ranges.shape[1], 0)  # at first
        ranges = np.concatenate((np.repeat(ranges[:, :1], missing, axis=1), ranges), axis=1)
        smallest, minus_largest = _smallest_of_last(ranges[:, -columns:], self._samples)
        lacking = self._limits.strength_share * np.minimum(np.minimum(smallest, minus_largest), 0.0)
        beyond: np.ndarray = np.maximum(torques + minus_largest, smallest - torques) + lacking
        return beyond


def _ranges(window: JointWindow) -> np.ndarray:
    """Smallest and negated largest torque commanded before each report of a window, N m, (2, k, n)."""
    commanded, first = window.commanded, window.first_commanded
    return np.array((np.minimum.reduceat(commanded, first), -np.maximum.reduceat(commanded, first)))


class CommandsIgnored(JointCheck):
    """Share of the changes of a motor's commands that its torque does not follow, over `commands_ignored_s`.

    Torque is kp (q* - q) + kd (v* - v) + feed-forward. With kp q + kd v added, the torque of a motor that
    executes one old command is constant, however small it is, while the commanded value changes. The gains
    are those of the old command: as gaits are periodic, it had the smallest or the largest recent stiffness.
    A late motor still shows all changes: its reports are used for `explained_s` longer. A weak motor ignores
    at most `strength_share`. A change by less than `torque_little` of the peak is not significant, and
    neither is a change in only one window: when a foot hits the ground, the reported torque still belongs to
    the speed before the impact. Commands that hardly change for the joint's mean position are not used: with
    gains that the motor does not have, the noise of a still joint's readings looks like a change.
    """

    quantity = "share of the command changes that a motor's torque does not follow: it holds an old command"
    message = "its torque does not follow its commands: it ignores {0:.0%} of their changes"
    limit = Limit("commands_ignored")

    def __init__(self, robot: Robot, limits: Limits, sample_s: float) -> None:
        self._limits, self._min_change = limits, limits.torque_little * robot.motor.peak_torque
        self._n = len(self._min_change)
        self._joints = np.arange(self._n)
        self.reset()

    def reset(self) -> None:
        # (6, n) each: position, velocity, torque, commanded torque, kp, kd
        self._windows: deque[np.ndarray] = deque()
        self._added, self._share = 0, np.zeros(self._n)

    def measure(self, window: JointWindow) -> np.ndarray:
        # A report may lag by this number of windows.
        late_windows = math.ceil(self._limits.explained_s / window.elapsed_s)
        count = max(2, math.ceil(self._limits.commands_ignored_s / window.elapsed_s))
        self._windows.append(np.concatenate((window.mean, window.commanded_mean[None], window.gains)))
        while len(self._windows) > count + late_windows:
            self._windows.popleft()
        self._added += 1
        if len(self._windows) < count + late_windows:
            self._share = np.zeros(self._n)
        elif self._added % WINDOWS_PER_SHARE == 0:
            self._share = self._ignored_share(count)
        return self._share

    def _ignored_share(self, count: int) -> np.ndarray:
        """Share of the changes in the first `count` windows that all windows do not follow, (n,)."""
        position, velocity, torque, commanded, kp, kd = np.array(self._windows).transpose(1, 0, 2)
        old_windows = np.array([kp.argmin(axis=0), kp.argmax(axis=0)]), self._joints
        readings = kp[old_windows][:, None] * position
        readings += kd[old_windows][:, None] * velocity
        followed = _deviation(torque + readings)
        mean_position = np.add.reduce(position) / len(position)
        at_mean = commanded + kp * (position - mean_position) + kd * velocity
        changes = _changed(np.concatenate((commanded + readings, at_mean[None]))[:, :count])
        changed, changed_at_mean = changes[:2], changes[2]
        ignored = (changed - followed) / np.maximum(changed, self._min_change)
        share: np.ndarray = np.where(changed_at_mean > self._min_change, np.maximum.reduce(ignored), 0.0)
        return share


def _changed(values: np.ndarray) -> np.ndarray:
    """Standard deviation along the second axis, without the value that is farthest from the mean.

    Without a value x, the sum of the k squared distances from the mean is smaller by x^2 k / (k - 1).
    """
    count = values.shape[1]
    squares = _squares(values)
    rest = np.add.reduce(squares, axis=1) - np.maximum.reduce(squares, axis=1) * (count / (count - 1))
    changed: np.ndarray = np.sqrt(np.maximum(rest, 0.0) / (count - 1))
    return changed


def _deviation(values: np.ndarray) -> np.ndarray:
    """Standard deviation along the second axis: as `values.std(axis=1)`, in half the time."""
    deviation: np.ndarray = np.sqrt(np.add.reduce(_squares(values), axis=1) / values.shape[1])
    return deviation


def _squares(values: np.ndarray) -> np.ndarray:
    """Squared distances from the mean along the second axis."""
    distances = values - np.add.reduce(values, axis=1, keepdims=True) / values.shape[1]
    distances *= distances
    return distances


def _smallest_of_last(values: np.ndarray, count: int) -> np.ndarray:
    """Minimum of each `count` successive values along the second axis, by doubling."""
    done = 1
    while done < count:
        step = min(done, count - done)
        values, done = np.minimum(values[:, step:], values[:, :-step]), done + step
    return values
