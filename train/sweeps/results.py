"""Results of a sweep: its trials, and its points over their seeds, the best first.

One training is a noisy measurement of its settings: the best of many single runs is mostly the luckiest one.
So each run's metric is a mean over its last iterations, and points are compared by their mean over seeds.
"""

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from statistics import fmean, stdev
from typing import Any, Literal, NamedTuple

LAST_ITERATIONS = 10  # of a run; their mean is its result
UNFINISHED = "unfinished"


class Trial(NamedTuple):
    """One training of a sweep."""

    folder: str
    seed: int
    settings: dict[str, Any]
    value: float  # mean of the metric over its last iterations; NaN if there is none
    steps: int
    error: str  # empty if it succeeded or the scheduler stopped it


class Point(NamedTuple):
    """One choice of settings, over all of its seeds."""

    settings: dict[str, Any]
    mean: float  # of the successful trials; NaN if there is none
    spread: float  # their standard deviation; NaN for a single trial
    seeds: int  # successful trials
    failed: int
    unfinished: int  # trials that an interruption ended


def last_value(metrics: Path, name: str, iterations: int = LAST_ITERATIONS) -> float:
    """Mean of a metric over the last iterations that report it; NaN if none does.

    Args:
        metrics: a run's metrics.jsonl. A line that a killed training did not finish is skipped.
    """
    if not metrics.is_file():
        return math.nan
    values = []
    for line in metrics.read_text(encoding="utf-8").splitlines():
        with suppress(json.JSONDecodeError):
            row = json.loads(line)
            if name in row:
                values.append(row[name])
    return fmean(values[-iterations:]) if values else math.nan


def points_of(trials: Iterable[Trial], mode: Literal["min", "max"]) -> list[Point]:
    """Trials grouped by settings, the best mean first; points with failed or unfinished trials last."""
    groups: dict[str, list[Trial]] = {}
    for trial in trials:
        groups.setdefault(json.dumps(trial.settings, sort_keys=True), []).append(trial)
    points = [_point(group) for group in groups.values()]
    sign = 1.0 if mode == "min" else -1.0
    return sorted(points, key=lambda p: (math.isnan(p.mean), p.failed + p.unfinished > 0, sign * p.mean))


def _point(trials: Sequence[Trial]) -> Point:
    values = [trial.value for trial in trials if not trial.error and not math.isnan(trial.value)]
    unfinished = sum(trial.error == UNFINISHED for trial in trials)
    return Point(
        settings=trials[0].settings,
        mean=fmean(values) if values else math.nan,
        spread=stdev(values) if len(values) > 1 else math.nan,
        seeds=len(values),
        failed=len(trials) - len(values) - unfinished,
        unfinished=unfinished,
    )


def points_table(points: Iterable[Point], names: Sequence[str], metric: str) -> str:
    """Points as comma-separated values."""
    rows = (
        [*(p.settings.get(n) for n in names), p.mean, p.spread, p.seeds, p.failed, p.unfinished]
        for p in points
    )
    return _csv([*names, f"mean {metric}", "standard deviation", "seeds", "failed", "unfinished"], rows)


def trials_table(trials: Iterable[Trial], names: Sequence[str], metric: str) -> str:
    """Trials as comma-separated values."""
    rows = (
        [t.folder, t.seed, *(t.settings.get(n) for n in names), t.value, t.steps, t.error] for t in trials
    )
    return _csv(["folder", "seed", *names, metric, "environment_steps", "error"], rows)


def _csv(header: list[str], rows: Iterable[list[Any]]) -> str:
    file = io.StringIO(newline="")
    writer = csv.writer(file)
    writer.writerow(header)
    writer.writerows(rows)
    return file.getvalue()
