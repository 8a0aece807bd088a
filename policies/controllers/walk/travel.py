"""Remaining travel of a stance foot that waits for its swing."""

from footfall.policies.controllers.walk.feet import FootCycle

_FAR, _TOO_FAR = 0.6, 0.9  # travel, as shares of a step's length, at which the body slows down, and stops
_RATE = 5.0  # 1/s, rate of change of the slowing


class TravelLimit:
    """Slows the body down if a stance foot travels too far.

    In a steady walk, feet are at most half a step's length from mid-stance. New commands, steps and gaits can
    cause larger distances.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start without slowing."""
        self._speed_share = 1.0

    def reduced(self, cycle: FootCycle, velocity: list[float], length_m: float, dt_s: float) -> list[float]:
        """The velocity (3,), reduced; `length_m` is the length of a step."""
        room = (_TOO_FAR - cycle.travel(velocity) / length_m) / (_TOO_FAR - _FAR)
        limit = _RATE * dt_s
        self._speed_share += min(max(min(max(room, 0.0), 1.0) - self._speed_share, -limit), limit)
        return [self._speed_share * part for part in velocity]
