"""How much room a foot that waits for its swing has left behind it."""

from footfall.policies.controllers.walk.feet import FootCycle

_FAR, _TOO_FAR = 0.6, 0.9  # of a step's length, from which on a foot slows the body down, and stops it
_RATE = 5.0  # 1/s, how fast it does


class Room:
    """Slows the body down where a standing foot is carried too far.

    A steady walk carries feet half a step's length out of their places; others come with new commands, other
    steps and other gaits.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """All feet are in their places."""
        self._share = 1.0

    def left_to(self, cycle: FootCycle, velocity: list[float], length_m: float, dt_s: float) -> list[float]:
        """The velocity (3,) that is left; `length_m` is that of a step."""
        room = (_TOO_FAR - cycle.carried(velocity) / length_m) / (_TOO_FAR - _FAR)
        most = _RATE * dt_s
        self._share += min(max(min(max(room, 0.0), 1.0) - self._share, -most), most)
        return [self._share * part for part in velocity]
