"""Unidentifiable parameters: directions without effect on residuals, and the profile over one parameter."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

MIN_LOADING = 0.3  # minimum part of a parameter in a direction, relative to the largest, to belong to it


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
    slope: np.ndarray, names: Sequence[str], noise: float = 1.0, max_deviation: float = 0.3
) -> tuple[Direction, ...]:
    """Unidentifiable directions of the parameters, the worst first.

    Args:
        slope: derivatives of the residuals, (m, p), by parameters in scales. A scale is a plausible
            difference between two machines.
        names: names of the p parameters.
        noise: standard deviation of the residuals.
        max_deviation: largest standard deviation along an identifiable direction, in scales.
    """
    _, singular, rows = np.linalg.svd(slope, full_matrices=True)
    sizes = np.zeros(len(names))
    sizes[: len(singular)] = singular
    found = []
    for size, row in zip(sizes[::-1], rows[::-1], strict=True):
        deviation = noise / max(float(size), 1e-12)
        if deviation < max_deviation:
            break
        parts = row / row[np.argmax(np.abs(row))]
        inside = np.flatnonzero(np.abs(parts) > MIN_LOADING)
        order = inside[np.argsort(-np.abs(parts[inside]), kind="stable")]
        found.append(Direction(deviation, {names[index]: float(parts[index]) for index in order}))
    return tuple(found)


class Profile(NamedTuple):
    """Best fits with one parameter fixed at each of G values."""

    values: np.ndarray  # (G,)
    misfit: np.ndarray  # (G,) of these fits
    numbers: np.ndarray  # (G, p) other parameters

    def range_within(self, factor: float) -> tuple[float, float]:
        """Minimum and maximum value whose misfit is at most `factor` times the best."""
        inside = self.values[self.misfit <= factor * self.misfit.min()]
        return float(inside.min()), float(inside.max())


def profile(fit_at: Callable[[float], tuple[float, np.ndarray]], values: Sequence[float]) -> Profile:
    """Fit all other parameters with one fixed.

    Args:
        fit_at: function of the fixed value, which returns the misfit and the other parameters.
        values: values of the fixed parameter.
    """
    fits = [fit_at(value) for value in values]
    return Profile(np.array(values), np.array([misfit for misfit, _ in fits]), np.array([x for _, x in fits]))
