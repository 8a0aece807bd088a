"""Clips velocity commands to the ranges of a policy."""

import math

import numpy as np

from footfall.robots.commands import CommandRange

_AXES = (("forward", "m/s"), ("leftward", "m/s"), ("yaw", "rad/s"))


Pairs = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


def _pairs(ranges: CommandRange) -> Pairs:
    return ranges.forward_m_s, ranges.leftward_m_s, ranges.yaw_rad_s


class CommandLimits:
    """Clips commands to a policy's ranges, with one note for each axis."""

    def __init__(
        self,
        ranges: CommandRange | None,
        notes: list[str] | None = None,
        fallback: CommandRange | None = None,
    ) -> None:
        """Without ranges, only values that are not finite change: to 0.

        Args:
            ranges: command ranges of the policy.
            notes: list to which notes are appended.
            fallback: ranges for `reduce` if the policy has none.
        """
        everything = (-math.inf, math.inf)
        self._ranges = (everything,) * 3 if ranges is None else _pairs(ranges)
        self.notes = [] if notes is None else notes
        reduced = self._ranges if ranges is not None or fallback is None else _pairs(fallback)
        self._reduced = np.array(reduced)
        self._noted: set[int] = set()

    def apply(self, command: np.ndarray) -> np.ndarray:
        """Command (3,) for the policy; the same array if nothing changes."""
        requested = command.tolist()
        within = [
            min(max(value, low), high) if math.isfinite(value) else 0.0
            for value, (low, high) in zip(requested, self._ranges, strict=True)
        ]
        if within == requested:
            return command
        for axis, (value, clipped) in enumerate(zip(requested, within, strict=True)):
            if value != clipped and axis not in self._noted:
                self._noted.add(axis)
                self.notes.append(self._note(axis, value, clipped))
        return np.array(within)

    def reduce(self, command: np.ndarray, share: float) -> np.ndarray:
        """Command within a share of the ranges, (3,). A range without 0 keeps its smallest speed."""
        low, high = self._reduced.T
        lower = np.where(low > 0.0, low, share * low)
        upper = np.where(high < 0.0, high, share * high)
        return command.clip(lower, np.maximum(lower, upper))

    def _note(self, axis: int, requested: float, clipped: float) -> str:
        (name, unit), (low, high) = _AXES[axis], self._ranges[axis]
        if not math.isfinite(requested):
            return f"a {name} command of {requested:g} {unit} was replaced with 0"
        return (
            f"the policy was trained on {name} commands from {low:g} to {high:g} {unit}:"
            f" {requested:g} was clipped to {clipped:g}"
        )
