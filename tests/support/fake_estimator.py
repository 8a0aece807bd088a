"""A base estimator that records its calls."""

from typing import Any

import numpy as np

from footfall.policies.policy import Sensed


class FakeEstimator:
    """The forward velocity, m/s, is the number of updates."""

    notes = ()

    def __init__(self, *_: Any) -> None:
        self.plans: list[object] = []
        self.resets = 0
        self.started: list[int] = []
        self.steps_s: list[float] = []

    def reset(self, sensed: Sensed) -> None:
        self.resets += 1

    def start(self) -> None:
        self.started.append(len(self.plans))

    def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple[np.ndarray, float]:
        self.plans.append(stance)
        self.steps_s.append(dt_s)
        return np.array([len(self.plans), 0.0, 0.0]), 0.25

    def pose(self) -> tuple[float, float, float]:
        return 0.0, 0.0, 0.0

    def odometry(self) -> None:
        return None
