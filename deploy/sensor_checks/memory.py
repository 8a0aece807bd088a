"""Decay of contradictions over time."""

import math
from dataclasses import dataclass

from footfall.common.config import require_between


@dataclass(frozen=True)
class Memory:
    """Common time constant of the checks of torques and of the base's rotation."""

    memory_s: float = 0.25  # time constant with which older contradictions decay

    def __post_init__(self) -> None:
        require_between(self, 0.01, 10.0, "memory_s")

    def kept(self, elapsed_s: float) -> float:
        """Remaining share of an older sum after this time."""
        return math.exp(-elapsed_s / self.memory_s)
