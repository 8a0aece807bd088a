"""Velocity and height of the base: from an estimator with its own rate, or from a simulation."""

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from footfall.deploy.command_source import UNKNOWN_POSE, Pose
from footfall.deploy.estimation.odometry import Odometry
from footfall.deploy.policy_runner import PolicyRunner
from footfall.policies.policy import Sensed

BaseStateFunction = Callable[
    [], tuple[np.ndarray, float]
]  # velocity of the base (3,) m/s, body frame, and height m
UNKNOWN = (np.full(3, np.nan), math.nan)
ODOMETRY_EVERY_US = 20_000  # interval for the log
POSE_EVERY_US = 20_000  # interval for the command source


class Estimator(Protocol):
    """Estimates the base's velocity (3,) m/s, body frame, and its height m, from readings."""

    def reset(self, sensed: Sensed) -> None: ...

    def start(self) -> None:
        """Set the pose to zero at the start of walking."""

    def stood_up(self, sensed: Sensed) -> None:
        """Start again at rest after a fall, at the position of the fall."""

    def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple[np.ndarray, float]: ...

    def pose(self) -> tuple[float, float, float]:
        """x m, y m and yaw rad since the start."""
        ...

    def odometry(self) -> Odometry: ...

    @property
    def notes(self) -> Sequence[str]:
        """Ignored sensors, one line each, without repetition. The list only grows."""
        ...


class BaseEstimate:
    """Latest estimate: from an estimator, from `base_state`, or unknown without either."""

    def __init__(
        self, rate_hz: float, estimator: Estimator | None = None, base_state: BaseStateFunction | None = None
    ) -> None:
        """`rate_hz`: minimum rate of the estimate; `base_state` replaces an estimator."""
        self._period_us = round(1e6 / rate_hz)
        self._estimator, self._base_state = estimator, base_state
        self._updated_us = -1
        self._next_odometry_us = self._next_pose_us = 0
        self._pose = UNKNOWN_POSE
        self.value = UNKNOWN

    @property
    def notes(self) -> Sequence[str]:
        """The estimator's notes."""
        return () if self._estimator is None else self._estimator.notes

    def reset(self, now_us: int, sensed: Sensed) -> None:
        """Start with these readings, when the robot begins to stand up."""
        self._updated_us = now_us
        if self._estimator is not None:
            self._estimator.reset(sensed)

    def start(self) -> None:
        """Set the pose to zero at the start of walking; the next `pose` is read anew."""
        self._next_pose_us = 0
        if self._estimator is not None:
            self._estimator.start()

    def invalidate(self) -> None:
        """Set velocity and height to unknown after a fall, until the robot stands."""
        self.value = UNKNOWN

    def stood_up(self, now_us: int, sensed: Sensed) -> None:
        """Continue after a fall, once the robot stands. The pose continues if it was known before the
        fall."""
        if self._updated_us < 0:
            self.reset(now_us, sensed)
            return
        self._updated_us = now_us
        if self._estimator is not None:
            self._estimator.stood_up(sensed)

    def due(self, now_us: int, step_due: bool) -> bool:
        """Whether an update is due: at the estimator's rate, and at each policy step."""
        if self._base_state is not None:
            return True
        return self._estimator is not None and (step_due or now_us - self._updated_us >= self._period_us)

    def update(self, now_us: int, sensed: Sensed, runner: PolicyRunner) -> None:
        """Update the estimate with these readings, unless the policy fails to give its contact plan."""
        if self._base_state is not None:
            self.value = self._base_state()
        elif self._estimator is not None:
            stance = runner.stance()
            if runner.signals.error:
                return
            self.value = self._estimator.update(sensed, stance, (now_us - self._updated_us) * 1e-6)
            self._updated_us = now_us

    def pose(self, now_us: int) -> Pose:
        """Pose of the base, at most 20 ms old; NaN without an estimator."""
        if self._estimator is not None and now_us >= self._next_pose_us and self._updated_us >= 0:
            self._next_pose_us = now_us + POSE_EVERY_US
            self._pose = Pose(*self._estimator.pose())
        return self._pose

    def odometry(self, now_us: int) -> Odometry | None:
        """Odometry of the base for the log; None if it is not due, or without an estimator."""
        if self._estimator is None or now_us < self._next_odometry_us:
            return None
        self._next_odometry_us = now_us + ODOMETRY_EVERY_US
        return self._estimator.odometry()
