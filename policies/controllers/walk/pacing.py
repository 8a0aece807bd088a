"""Pace of a walk: strides and tempo, recomputed when the command or the walk changes."""

import math
from collections.abc import Callable

import numpy as np

from footfall.policies.controllers.walk.limits import Pace, SteadyWalk, WalkLimits

_CHANGE = np.array([0.005, 0.005, 0.02])  # changes of the desired velocity after which the pace is recomputed
_TEMPO_RATE = 0.5  # 1/s, largest rise of the tempo; it falls immediately


class Pacing:
    """Pace of a walk that follows commands.

    Args:
        limits: limits of the walk.
        farthest_m: largest distance of a foot from the base's origin.
    """

    def __init__(self, limits: WalkLimits, farthest_m: float) -> None:
        self._limits, self._farthest = limits, farthest_m
        self.reset()

    def reset(self) -> None:
        """Start without a command."""
        self._requested = [0.0, 0.0, 0.0]
        self._attainable = np.zeros(3)
        self._pace = self._previous_pace = Pace()
        self.tempo = 1.0
        self.invalidate()

    def invalidate(self) -> None:
        """Recompute the pace at the next call, because the walk has changed."""
        self._checked_velocity: np.ndarray | None = None

    @property
    def reason(self) -> str:
        """Why the walk is slower than commanded; empty if it is not."""
        return self._pace.reason

    def reduced_command(
        self, command: np.ndarray, stance_s: float, length_m: float, walk: Callable[[np.ndarray], SteadyWalk]
    ) -> np.ndarray:
        """The command (3,), reduced to the steps' length, the legs' reach and the stability margin.

        No foot travels farther than a step's length in one stance.

        Args:
            command: desired velocity.
            stance_s: duration of a stance.
            length_m: length of a step.
            walk: gives the steady walk at a velocity (3,).
        """
        requested = command.tolist()
        if self._checked_velocity is not None and requested == self._requested:
            return self._attainable
        self._requested = requested
        forward, leftward, yaw_rate = requested
        speed = math.hypot(forward, leftward) + abs(yaw_rate) * self._farthest
        reduced = command * min(1.0, length_m / max(speed * stance_s, 1e-9))
        if self._checked_velocity is None or np.any(np.abs(reduced - self._checked_velocity) >= _CHANGE):
            self._checked_velocity = reduced.copy()
            self._previous_pace, self._pace = self._pace, self._limits.pace(walk(reduced))
        self._attainable = self._pace.stride * reduced
        return self._attainable

    def set_tempo(self, steady: bool, dt_s: float) -> None:
        """Update the tempo. During a change of velocity (not `steady`), the tempo suits both velocities."""
        limit = self._pace.tempo if steady else min(self._pace.tempo, self._previous_pace.tempo)
        self.tempo = min(limit, self.tempo + _TEMPO_RATE * dt_s)
