"""The figures that tables and the report show: names, units, which way is better, how they are defined."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

from footfall.common.config import load

Summary = Mapping[str, Any]
NOTHING = "–"


@dataclass(frozen=True)
class Figure:
    """One row of a table. Dots in `key` lead into nested parts of a summary."""

    key: str
    label: str
    about: str
    unit: str = ""
    digits: int = 0
    better: Literal["low", "high", ""] = ""
    upright: bool = False
    headline: bool = False

    @property
    def title(self) -> str:
        return f"{self.label} ({self.unit})" if self.unit else self.label


@dataclass(frozen=True)
class FigureFile:
    """The content of `figures.yaml`."""

    figures: tuple[Figure, ...]


@cache
def figures() -> dict[str, Figure]:
    """All figures by key, in the order in which they are shown."""
    found = load(Path(__file__).parent / "figures.yaml", FigureFile).figures
    return {figure.key: figure for figure in found}


def value(figure: Figure, summary: Summary) -> float | None:
    """The number, or None where it was not measured. Infinite for a push that nobody could find."""
    if figure.key == "dv50" and summary.get("dv50") is None:
        return math.inf if _stood_all_pushes(summary) else None
    found: Any = summary
    for part in figure.key.split("."):
        found = found.get(part) if isinstance(found, Mapping) else None
    return None if found is None else float(found)


def text(figure: Figure, summary: Summary) -> str:
    """The number as it is shown."""
    if figure.key == "falls":
        return f"{summary['falls']} of {summary['episodes']}"
    number = value(figure, summary)
    if number == math.inf:
        return f"above {summary['strongest_push']:g}"
    if number is None and figure.key == "dv50" and "strongest_push" in summary:
        return "below the weakest"
    return _rounded(figure, number)


def interval_text(figure: Figure, summary: Summary) -> str:
    """Its 95 % interval as it is shown, or nothing."""
    if figure.key == "falls":
        low, high = summary["fall_rate_interval"]
        return f"{100 * low:.0f} to {100 * high:.0f} %"
    low, high = summary.get(f"{figure.key}_interval") or (None, None)
    if low is None or value(figure, summary) is None:
        return ""
    return f"{_rounded(figure, low)} to {_rounded(figure, high) if high is not None else 'beyond'}"


def measured(figure: Figure, summaries: Sequence[Summary]) -> bool:
    """Whether a figure is worth a row: somebody has a value, and an emergency stop is news."""
    if figure.key == "emergency_stops":
        return any(summary["emergency_stops"] for summary in summaries)
    if figure.key == "dv50":
        return any("dv50" in summary for summary in summaries)
    return any(value(figure, summary) is not None for summary in summaries)


def best(figure: Figure, summaries: Sequence[Summary]) -> set[int]:
    """Which of several contenders are best; none where all are equal or no way is better.

    An upright figure is contended for by those that fell least only.
    """
    values = [value(figure, summary) for summary in summaries]
    if figure.upright:
        fewest = min(summary["falls"] for summary in summaries)
        values = [
            number if summary["falls"] == fewest else None
            for number, summary in zip(values, summaries, strict=True)
        ]
    known = [number for number in values if number is not None]
    if not figure.better or len(known) < 2 or min(known) == max(known):
        return set()
    goal = min(known) if figure.better == "low" else max(known)
    return {index for index, number in enumerate(values) if number == goal}


def _stood_all_pushes(summary: Summary) -> bool:
    return "strongest_push" in summary and 2 * summary["falls"] < summary["episodes"]


def _rounded(figure: Figure, number: float | None) -> str:
    return NOTHING if number is None else f"{number:.{figure.digits}f}"
