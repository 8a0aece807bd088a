"""Figures of tables and report: names, units, intervals, and which policy is clearly better."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any, Literal

from footfall.common.config import load

Summary = Mapping[str, Any]
NO_VALUE = "–"
COUNTS = ("falls", "successes", "missions_done", "missions_arrived", "legs_touch_episodes")  # of episodes
RATES = {  # keys of their intervals, which are shares
    "falls": "fall_rate_interval",
    "successes": "success_rate_interval",
    "missions_arrived": "arrival_rate_interval",
}
# A bootstrap over fewer episodes gives an interval that is too narrow to rank policies.
MIN_EPISODES = 8


@dataclass(frozen=True)
class Figure:
    """One row of a table. Dots in `key` lead into nested parts of a summary."""

    key: str
    label: str
    about: str
    unit: str = ""
    digits: int = 0
    better: Literal["low", "high", ""] = ""
    blocked_by_falls: bool = False
    is_headline: bool = False
    claim: str = ""  # phrase about the leader of a headline figure: "falls least often"

    @property
    def title(self) -> str:
        return f"{self.label} ({self.unit})" if self.unit else self.label


@dataclass(frozen=True)
class FigureFile:
    """The content of `figures.yaml`."""

    figures: tuple[Figure, ...]


@cache
def figures() -> dict[str, Figure]:
    """All figures by key, in display order."""
    file = load(Path(__file__).parent / "figures.yaml", FigureFile)
    return {figure.key: figure for figure in file.figures}


def value(figure: Figure, summary: Summary) -> float | None:
    """The figure's value; None if not measured, infinite for a median push above the strongest tested."""
    if figure.key == "dv50" and summary.get("dv50") is None:
        return math.inf if _stood_most_pushes(summary) else None
    entry: Any = summary
    for part in figure.key.split("."):
        entry = entry.get(part) if isinstance(entry, Mapping) else None
    return None if entry is None else float(entry)


def interval(figure: Figure, summary: Summary) -> tuple[float, float] | None:
    """The figure's 95 % interval (of falls: as a share of episodes); None if it has none."""
    key = RATES.get(figure.key, f"{figure.key}_interval")
    if key not in summary or (figure.key != "dv50" and value(figure, summary) is None):
        return None
    if figure.key == "dv50":  # None means above the strongest push
        low, high = (math.inf if edge is None else edge for edge in summary[key])
        return low, high
    low, high = summary[key]
    return None if low is None or high is None else (low, high)


def text(figure: Figure, summary: Summary) -> str:
    """The figure's value as text."""
    number = value(figure, summary)
    if figure.key in COUNTS and number is not None:
        return f"{number:.0f} of {summary['episodes']}"
    if number == math.inf:
        return f"above {summary['strongest_push']:g}"
    if number is None and figure.key == "dv50" and "strongest_push" in summary:
        return f"below {summary.get('weakest_push', math.nan):g}"
    return _rounded(figure, number)


def interval_text(figure: Figure, summary: Summary) -> str:
    """The figure's 95 % interval as text; empty if it has none."""
    edges = interval(figure, summary)
    if edges is None or math.isinf(edges[0]) or value(figure, summary) is None:
        return ""
    low, high = edges
    if figure.key in RATES:
        return f"{100 * low:.0f} to {100 * high:.0f} %"
    return f"{_rounded(figure, low)} to {_rounded(figure, high) if math.isfinite(high) else 'beyond'}"


def measured(figure: Figure, summaries: Sequence[Summary]) -> bool:
    """Whether a figure gets a row: a policy has a value; emergency stops, only if there were any."""
    if figure.key == "emergency_stops":
        return any(summary.get("emergency_stops") for summary in summaries)
    if figure.key == "dv50":
        return any("dv50" in summary for summary in summaries)
    return any(value(figure, summary) is not None for summary in summaries)


def beats(figure: Figure, one: Summary, other: Summary) -> bool:
    """Whether one policy is clearly better than another: their intervals do not overlap.

    With `blocked_by_falls`, a policy that fell more often is never better: a robot that falls early makes few
    errors and uses little energy.
    """
    first, second = interval(figure, one), interval(figure, other)
    too_few = min(one["episodes"], other["episodes"]) < MIN_EPISODES and figure.key not in RATES
    if first is None or second is None or too_few:
        return False
    if figure.blocked_by_falls and one["fall_rate"] > other["fall_rate"]:
        return False
    return (
        first[1] < second[0] if figure.better == "low" else figure.better == "high" and first[0] > second[1]
    )


def leaders(figure: Figure, summaries: Sequence[Summary]) -> set[int]:
    """Smallest group of policies that are each better than all others with an interval; may be empty."""
    ranked = [index for index, summary in enumerate(summaries) if interval(figure, summary) is not None]
    for size in range(1, len(ranked)):
        for group in combinations(ranked, size):
            rest = [index for index in ranked if index not in group]
            if all(beats(figure, summaries[one], summaries[other]) for one in group for other in rest):
                return set(group)
    return set()


def best(figure: Figure, summaries: Sequence[Summary]) -> int | None:
    """Index of the policy that beats all others, if there is one."""
    leading = leaders(figure, summaries)
    return leading.pop() if len(leading) == 1 else None


def _stood_most_pushes(summary: Summary) -> bool:
    return "strongest_push" in summary and 2 * summary["falls"] < summary["episodes"]


def _rounded(figure: Figure, number: float | None) -> str:
    return NO_VALUE if number is None else f"{number:.{figure.digits}f}"
