"""How fast a walk may be: strides and tempo, found anew when what is asked for changes."""

import math
from collections.abc import Callable

import numpy as np

from footfall.policies.controllers.walk.limits import Pace, SteadyWalk, WalkLimits

_CHANGE = np.array([0.005, 0.005, 0.02])  # of the wanted velocity, after which the limits are looked at again
_TEMPO_RATE = 0.5  # 1/s, how fast the tempo may rise; it falls at once


class Pacing:
    """The pace of a walk that follows commands.

    Args:
        limits: of the walk.
        farthest_m: of a foot from the base's origin.
    """

    def __init__(self, limits: WalkLimits, farthest_m: float) -> None:
        self._limits, self._farthest = limits, farthest_m
        self.reset()

    def reset(self) -> None:
        """Nothing was asked for."""
        self._asked = [0.0, 0.0, 0.0]
        self._attainable = np.zeros(3)
        self._pace = self._before = Pace()
        self.tempo = 1.0
        self.look_again()

    def look_again(self) -> None:
        """The walk itself has changed."""
        self._looked_at: np.ndarray | None = None

    @property
    def reason(self) -> str:
        """Why the walk is slower than asked for; empty if it is not."""
        return self._pace.reason

    def within(
        self, command: np.ndarray, stance_s: float, length_m: float, walk: Callable[[np.ndarray], SteadyWalk]
    ) -> np.ndarray:
        """The command (3,) as far as steps' length, legs' reach and the stability margin allow.

        No foot is carried back farther than a step's length in one stance.

        Args:
            command: that is asked for.
            stance_s: duration of a stance.
            length_m: of a step.
            walk: the steady walk at a velocity (3,).
        """
        asked = command.tolist()
        if self._looked_at is not None and asked == self._asked:
            return self._attainable
        self._asked = asked
        forward, leftward, yaw_rate = asked
        speed = math.hypot(forward, leftward) + abs(yaw_rate) * self._farthest
        within = command * min(1.0, length_m / max(speed * stance_s, 1e-9))
        if self._looked_at is None or np.any(np.abs(within - self._looked_at) >= _CHANGE):
            self._looked_at = within.copy()
            self._before, self._pace = self._pace, self._limits.pace(walk(within))
        self._attainable = self._pace.stride * within
        return self._attainable

    def set_tempo(self, steady: bool, dt_s: float) -> None:
        """On the way from one velocity to another, not `steady`, the tempo suits both."""
        most = self._pace.tempo if steady else min(self._pace.tempo, self._before.tempo)
        self.tempo = min(most, self.tempo + _TEMPO_RATE * dt_s)
