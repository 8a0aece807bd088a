"""Distributions, drawn through their quantile functions.

A quantile function turns uniform numbers in [0, 1) into draws by plain arithmetic, so the same
declaration serves JAX (whole batches on an accelerator) and NumPy (one plant at a time).
"""

from dataclasses import dataclass
from typing import Any, Literal

Array = Any


@dataclass(frozen=True)
class Distribution:
    """A uniform or log-uniform distribution over [low, high]."""

    low: float
    high: float
    shape: Literal["uniform", "log_uniform"] = "uniform"

    def __post_init__(self) -> None:
        if not self.low <= self.high:
            raise ValueError(f"low {self.low} is above high {self.high}")
        if self.shape == "log_uniform" and self.low <= 0:
            raise ValueError(f"a log-uniform distribution needs low above 0, not {self.low}")

    def quantile(self, u: Array) -> Array:
        """Draws from uniform numbers u in [0, 1); same shape as u."""
        if self.shape == "log_uniform":
            return self.low * (self.high / self.low) ** u
        return self.low + (self.high - self.low) * u
