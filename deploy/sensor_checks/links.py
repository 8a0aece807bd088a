"""Checks of the rates of readings: shares over time, which no single window shows.

In first rest, while the robot stands up, the checks measure the usual rates, the reference for later shares.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from footfall.common.config import require_between
from footfall.deploy.modes import Mode
from footfall.deploy.sensor_checks.check import Limit, SensorCheck
from footfall.deploy.sensor_checks.link_window import LinkWindow
from footfall.robots.description import Robot

OLDER_MEMORY_S = 0.1  # averaging time for older samples: a few windows are enough


@dataclass(frozen=True)
class LinkLimits:
    """Limits of lost, repeated and reordered readings."""

    lost_share: float = 0.2  # of a motor's or the IMU's readings, more than were lost in first rest
    lost_memory_s: float = 0.5  # time constant of the mean losses and repeats
    frozen_share: float = 0.15  # of the IMU's readings equal to the previous one while joints move
    replayed_s: float = 0.06  # for which readings repeat those of a constant time before in motion
    older_share: float = 0.1  # of the IMU's samples that are older than its latest
    foreign_replies: float = 5.0  # replies of a motor within `lost_memory_s` without a frame of this host

    def __post_init__(self) -> None:
        require_between(self, 0.01, 1.0, "lost_share", "frozen_share", "older_share")
        require_between(self, 0.01, 60.0, "lost_memory_s", "replayed_s")
        require_between(self, 1.0, 1000.0, "foreign_replies")


class LinkCheck(SensorCheck, ABC):
    """A check of the messages' rates. A value above the limit is a fault."""

    message: ClassVar[str]  # {0} is the value

    @abstractmethod
    def measure(self, window: LinkWindow) -> np.ndarray | float:
        """Value after another window: for each motor (n,), or for the IMU."""


class Answers(LinkCheck):
    """Number of a motor's replies in excess of the sent frames, over about `lost_memory_s`.

    Late replies in bursts cancel out, because they were missing before. 0 for motors that send unasked.
    """

    quantity = "replies of a motor to frames of another host"
    message = (
        "answered {0:.0f} frames that were not sent from here: a second host on the bus commands it, too"
    )
    limit = Limit("foreign_replies")

    _limits: LinkLimits

    def reset(self) -> None:
        self._foreign = np.zeros(self._n)

    def measure(self, window: LinkWindow) -> np.ndarray:
        if window.answering:
            kept = math.exp(-window.elapsed_s / self._limits.lost_memory_s)
            self._foreign = kept * self._foreign + (window.replies - window.commanded)
        return self._foreign


class Unanswered(LinkCheck):
    """Mean share of a motor's lost replies, relative to the rate in first rest.

    In first rest it is the share of the frames without a reply.
    """

    quantity = "lost share of a motor's replies, relative to the first rest"
    message = "{0:.0%} of its commands or replies are lost"
    limit = Limit("lost_share")
    leads_to = Mode.LOWERING

    _limits: LinkLimits

    def reset(self) -> None:
        self._lost, self._arrived = np.zeros((2, self._n))
        # With `lost_share` 1 a motor may send nothing in first rest: then it loses nothing later.
        self._answered, self._inverse = np.ones((2, self._n))  # 0 or 1, and 1 / usual rate, or 0
        self._windows = 0

    def measure(self, window: LinkWindow) -> np.ndarray:
        rate = window.replies / max(window.commanded, 1)
        if window.resting:
            self._windows += 1
            self._arrived = self._arrived + rate
            usual = np.maximum(self._arrived / self._windows, 1.0 - self._limits.lost_share)
            self._answered = (usual > 0.0).astype(float)
            self._inverse = self._answered / np.where(usual > 0.0, usual, 1.0)
            lost = 1.0 - rate if window.answering else 0.0 * rate
        else:
            lost = self._answered - rate * self._inverse
        self._lost = _updated(self._lost, lost, window, self._limits)
        return self._lost


class ImuLost(LinkCheck):
    """Mean share of the IMU's lost readings, relative to the rate in first rest."""

    quantity = "lost share of the IMU's readings, relative to the first rest"
    message = "the IMU: {0:.0%} of its readings are lost"
    limit = Limit("lost_share")

    _limits: LinkLimits

    def reset(self) -> None:
        self._lost, self._baseline, self._windows = 0.0, 0.0, 0

    def measure(self, window: LinkWindow) -> float:
        if window.resting:
            self._windows += 1
            self._baseline += (window.imu_new - self._baseline) / self._windows
            return 0.0
        lost = 1.0 - window.imu_new / self._baseline if self._baseline else 0.0
        self._lost = _updated(self._lost, lost, window, self._limits)
        return self._lost


class ImuFrozen(LinkCheck):
    """Mean share of the IMU's new readings that equal the previous one while joints move."""

    quantity = "share of the IMU's new readings that equal the previous one while joints move"
    message = "the IMU: {0:.0%} of its new readings repeat the one before while joints move"
    limit = Limit("frozen_share")

    _limits: LinkLimits

    def reset(self) -> None:
        self._share = 0.0

    def measure(self, window: LinkWindow) -> float:
        if window.moving:
            self._share = _updated(self._share, window.imu_repeated, window, self._limits)
        return self._share


class ImuReplayed(LinkCheck):
    """How long the IMU's readings have equalled those of a constant time before while joints move, s."""

    quantity = "time for which the IMU's readings equal earlier ones in sequence while joints move: a replay"
    message = "the IMU: its readings have been those of a while ago for {0:.2f} s: they are replayed"
    limit = Limit("replayed_s")

    def measure(self, window: LinkWindow) -> float:
        return window.imu_replayed_s if window.moving else 0.0


class ImuOlder(LinkCheck):
    """Mean number of the IMU's samples older than its latest, per new sample."""

    quantity = "share of the IMU's samples whose counter runs back"
    message = (
        "the IMU: its sample counter runs back: its frames are replayed or out of order, or it restarted"
    )
    limit = Limit("older_share")

    def __init__(self, robot: Robot, limits: LinkLimits, sample_s: float) -> None:
        self._sample_s = sample_s
        self.reset()

    def reset(self) -> None:
        self._share = 0.0

    def measure(self, window: LinkWindow) -> float:
        kept = math.exp(-window.elapsed_s / OLDER_MEMORY_S)
        samples = max(window.elapsed_s / self._sample_s, 1.0)
        self._share = kept * self._share + (1.0 - kept) * window.imu_older / samples
        return self._share


def _updated(share: Any, latest: Any, window: LinkWindow, limits: LinkLimits) -> Any:
    """Mean share after another window."""
    weight = 1.0 - math.exp(-window.elapsed_s / limits.lost_memory_s)
    return share + weight * (latest - share)
