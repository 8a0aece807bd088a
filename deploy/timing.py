"""Durations of ticks and policy steps, with bounded memory."""

from array import array
from dataclasses import dataclass, field

import numpy as np

MAX_SAMPLES = 2**16  # number of each kind: two minutes of ticks at 500 Hz


class Durations:
    """Latest durations of one kind, and the maximum of all."""

    def __init__(self, capacity: int = MAX_SAMPLES) -> None:
        self._values = array("d", bytes(8 * capacity))
        self._capacity = capacity
        self.count = 0
        self.longest = 0.0

    def add(self, value: float) -> None:
        self._values[self.count % self._capacity] = value
        self.count += 1
        self.longest = max(self.longest, value)

    def values(self, max_count: int = MAX_SAMPLES) -> np.ndarray:
        """Up to `max_count` latest durations, oldest first."""
        number = min(max_count, self.count, self._capacity)
        end = (self.count - 1) % self._capacity + 1
        if number <= end:
            return np.array(self._values[end - number : end])
        return np.array(self._values[end - number :] + self._values[:end])


@dataclass
class Timing:
    """Timing of the loop."""

    lateness_us: Durations = field(default_factory=Durations)  # of each tick; wall clock only
    tick_us: Durations = field(default_factory=Durations)  # duration of each tick's work
    policy_ms: Durations = field(default_factory=Durations)  # duration of each policy step
    overruns: int = 0  # ticks whose work took longer than the period; wall clock only
    ticks_skipped: int = 0  # because the loop was late; wall clock only

    def summary(self, max_count: int = MAX_SAMPLES) -> dict[str, float]:
        """By name: p50 and p99 of up to `max_count` latest durations, the maximum of all; 0 without any."""
        summary = {"ticks": float(self.tick_us.count), "overruns": float(self.overruns)}
        summary["ticks_skipped"] = float(self.ticks_skipped)
        for name in ("lateness_us", "tick_us", "policy_ms"):
            durations: Durations = getattr(self, name)
            values = durations.values(max_count) if durations.count else np.zeros(1)
            summary[f"{name}_p50"], summary[f"{name}_p99"] = np.percentile(values, (50, 99)).tolist()
            summary[f"{name}_max"] = durations.longest
        return summary
