"""Unidentifiable parameters: directions without effect on residuals, and the profile over one parameter."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

LOADING = 0.3  # minimum part of a parameter in a direction, relative to the largest, to belong to it


class Direction(NamedTuple):
    """Parameters that can change together without effect on the data."""

    deviation: float  # standard deviation along it, in scales
    parts: dict[str, float]  # part of each parameter, in scales; the largest is 1

    @property
    def text(self) -> str:
        """Text for reports."""
        parts = " ".join(f"{part:+.2f} {name}" for name, part in self.parts.items())
        return f"{parts} (deviation {self.deviation:.2g} scales)"


def null_directions(
    slope: np.ndarray, names: Sequence[str], noise: float = 1.0, untold: float = 0.3
) -> tuple[Direction, ...]:
    """Directions that the data tell worse than by `untold` scales, the worst first.

    Args:
        slope: of the residuals, (m, p), each parameter in its scale: a plausible difference of two machines.
        names: of the p parameters.
        noise: deviation of the residuals.
        untold: deviation from which a direction is not told.
    """
    _, singular, rows = np.linalg.svd(slope, full_matrices=True)
    sizes = np.zeros(len(names))
    sizes[: len(singular)] = singular
    found = []
    for size, row in zip(sizes[::-1], rows[::-1], strict=True):
        deviation = noise / max(float(size), 1e-12)
        if deviation < untold:
            break
        parts = row / row[np.argmax(np.abs(row))]
        inside = np.flatnonzero(np.abs(parts) > LOADING)
        order = inside[np.argsort(-np.abs(parts[inside]), kind="stable")]
        found.append(Direction(deviation, {names[place]: float(parts[place]) for place in order}))
    return tuple(found)


class Profile(NamedTuple):
    """Best fits with one parameter fixed at each of G values."""

    values: np.ndarray  # (G,)
    misfit: np.ndarray  # (G,) of these fits
    numbers: np.ndarray  # (G, p) the other parameters

    def range_within(self, factor: float) -> tuple[float, float]:
        """Minimum and maximum value whose misfit is at most `factor` times the best."""
        inside = self.values[self.misfit <= factor * self.misfit.min()]
        return float(inside.min()), float(inside.max())


def profile(fit_at: Callable[[float], tuple[float, np.ndarray]], values: Sequence[float]) -> Profile:
    """Fit all other parameters with one fixed.

    Args:
        fit_at: from a value of the held one to the misfit and the numbers of the others.
        values: to hold it at.
    """
    fits = [fit_at(value) for value in values]
    return Profile(np.array(values), np.array([misfit for misfit, _ in fits]), np.array([x for _, x in fits]))
