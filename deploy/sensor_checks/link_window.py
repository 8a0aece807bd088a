"""Counts of one window: frames to the motors, their replies, and samples of the IMU."""

from typing import NamedTuple

import numpy as np

from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.sensor_checks.replay import ReplayFinder


class LinkWindow(NamedTuple):
    """Messages of n motors and the IMU during a window."""

    elapsed_s: float
    commanded: int  # number of ticks with a frame to each motor
    replies: np.ndarray  # number of replies of each motor, (n,)
    imu_new: float  # share of the samples with a new reading of the IMU
    imu_repeated: float  # share of the samples with a new reading equal to the previous one
    imu_replayed_s: float  # how long readings have equalled earlier ones at a constant delay
    imu_older: int  # number of the IMU's samples that were older than its latest
    moving: bool  # whether any joint moves
    resting: bool  # whether the robot is in first rest: it is still standing up
    answering: bool = True  # whether motors reply to each frame, and send nothing else


class LinkSums:
    """Counts messages until a window is full."""

    def __init__(self, answering: bool) -> None:
        """`answering`: whether motors reply to each frame, and send nothing else."""
        self._answering = answering
        self._replay = ReplayFinder()
        self.begin(0, np.zeros(0, np.intp), 0, 0, Inertial((0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0)))

    def begin(
        self, now_us: int, replies: np.ndarray, imu_older: int, imu_us: int, inertial: Inertial
    ) -> None:
        """Reset, and count relative to these totals: see `add` and `close`."""
        self._began_us, self._replies, self._imu_older = now_us, replies, imu_older
        self._imu_us, self._inertial = imu_us, inertial
        self._replay.reset()
        self._start()

    def _start(self) -> None:
        self._commands = self._samples = self._new = self._repeated = 0

    def count_command(self) -> None:
        """Count a tick in which each motor was sent a frame."""
        self._commands += 1

    def add(self, imu_us: int, inertial: Inertial) -> None:
        """Count a reading of the IMU, with its arrival time, us."""
        self._samples += 1
        if imu_us != self._imu_us:
            self._new += 1
            self._repeated += inertial == self._inertial
            self._replay.update(imu_us, inertial)
            self._imu_us, self._inertial = imu_us, inertial

    def close(
        self, now_us: int, replies: np.ndarray, imu_older: int, moving: bool, resting: bool
    ) -> LinkWindow:
        """End the window and start the next one.

        Args:
            now_us: time of the loop.
            replies: total number of replies of each motor so far, (n,).
            imu_older: samples so far that were older than the IMU's latest.
            moving: whether any joint moves.
            resting: whether the robot is still standing up.
        """
        samples = max(self._samples, 1)
        window = LinkWindow(
            1e-6 * (now_us - self._began_us),
            self._commands,
            replies - self._replies,
            self._new / samples,
            self._repeated / samples,
            self._replay.replayed_s,
            imu_older - self._imu_older,
            moving,
            resting,
            self._answering,
        )
        self._began_us, self._replies, self._imu_older = now_us, replies, imu_older
        self._start()
        return window
