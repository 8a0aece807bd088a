"""How contradictions of readings fade."""

import math
from dataclasses import dataclass

from footfall.common.config import require_between


@dataclass(frozen=True)
class Memory:
    """The time constant that checks of torques and of the base's turn share."""

    memory_s: float = 0.25  # over which contradictions add up; older ones fade

    def __post_init__(self) -> None:
        require_between(self, 0.01, 10.0, "memory_s")

    def kept(self, elapsed_s: float) -> float:
        """Share of an older sum that is left after this time."""
        return math.exp(-elapsed_s / self.memory_s)
