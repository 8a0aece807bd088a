"""The base's velocity and height: estimated at a rate of its own, or given by a simulation."""

import math
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from footfall.deploy.command_source import UNKNOWN_POSE, Pose
from footfall.deploy.estimation.odometry import Odometry
from footfall.deploy.policy_runner import PolicyRunner
from footfall.policies.policy import Sensed

BaseState = Callable[[], tuple[np.ndarray, float]]  # the base's velocity (3,) m/s, body frame, and height m
UNKNOWN = (np.full(3, np.nan), math.nan)
ODOMETRY_EVERY_US = 20_000  # for the log
POSE_EVERY_US = 20_000  # for the command source


class Estimator(Protocol):
    """Estimates the base's velocity (3,) m/s, body frame, and height m from readings."""

    def reset(self, sensed: Sensed) -> None: ...

    def start(self) -> None:
        """Set the pose to zero: the policy takes over."""

    def stood_up(self, sensed: Sensed) -> None:
        """Begin again at rest after a fall, at the place of the fall."""

    def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple[np.ndarray, float]: ...

    def pose(self) -> tuple[float, float, float]:
        """x m, y m and yaw rad since the start."""
        ...

    def odometry(self) -> Odometry: ...

    @property
    def notes(self) -> Sequence[str]:
        """Sensors that it ignores, one line each, each once. The sequence only grows."""
        ...


class BaseEstimate:
    """The latest estimate: by an estimator, by `base_state`, or unknown without either."""

    def __init__(
        self, rate_hz: float, estimator: Estimator | None = None, base_state: BaseState | None = None
    ) -> None:
        """`rate_hz`: how often to estimate at least; `base_state` takes the place of an estimator."""
        self._every_us = round(1e6 / rate_hz)
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
        """The robot begins to stand up with these readings."""
        self._updated_us = now_us
        if self._estimator is not None:
            self._estimator.reset(sensed)

    def start(self) -> None:
        """The policy takes over."""
        if self._estimator is not None:
            self._estimator.start()

    def lose(self) -> None:
        """The robot fell: its velocity and height are unknown until it stands."""
        self.value = UNKNOWN

    def stood_up(self, now_us: int, sensed: Sensed) -> None:
        """The robot stands after a fall. The pose goes on from where it fell, if it had stood before."""
        if self._updated_us < 0:
            self.reset(now_us, sensed)
            return
        self._updated_us = now_us
        if self._estimator is not None:
            self._estimator.stood_up(sensed)

    def due(self, now_us: int, step_due: bool) -> bool:
        """Whether to estimate anew: at the estimator's rate, and where the policy takes its step."""
        if self._base_state is not None:
            return True
        return self._estimator is not None and (step_due or now_us - self._updated_us >= self._every_us)

    def update(self, now_us: int, sensed: Sensed, runner: PolicyRunner) -> None:
        """Estimate anew from these readings, unless the policy fails to give its contact plan."""
        if self._base_state is not None:
            self.value = self._base_state()
        elif self._estimator is not None:
            stance = runner.stance()
            if runner.signals.error:
                return
            self.value = self._estimator.update(sensed, stance, (now_us - self._updated_us) * 1e-6)
            self._updated_us = now_us

    def pose(self, now_us: int) -> Pose:
        """Where the base is, some ms old at most; NaN without an estimator."""
        if self._estimator is not None and now_us >= self._next_pose_us and self._updated_us >= 0:
            self._next_pose_us = now_us + POSE_EVERY_US
            self._pose = Pose(*self._estimator.pose())
        return self._pose

    def odometry(self, now_us: int) -> Odometry | None:
        """The base's motion for the log; None if it is not due, or without an estimator."""
        if self._estimator is None or now_us < self._next_odometry_us:
            return None
        self._next_odometry_us = now_us + ODOMETRY_EVERY_US
        return self._estimator.odometry()
