"""Learning curves of the policies that users named by run folder."""

import json
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from markupsafe import Markup

from footfall.evaluate.report.svg import Panel, Plot, Reading, line

METRICS_FILE = "metrics.jsonl"  # one JSON object a line, with "step" and the metrics of that iteration
CURVES = {
    "reward/total": "reward, per second",
    "tracking/linear_error_m_s": "velocity error in training, m/s",
    "episode/length_s": "length of an episode, s",
}
MAX_POINTS = 240  # of a curve, each the mean of an interval

Points = np.ndarray  # (k, 2): environment steps, value


def learning_curves(specs: Mapping[str, str]) -> Plot:
    """Curves of the policies that are run folders.

    Args:
        specs: {policy: text that the user typed}, in the order of their colours.
    """
    metrics = {name: read_metrics(Path(spec) / METRICS_FILE) for name, spec in specs.items()}
    panels = []
    for number, (metric, label) in enumerate(CURVES.items()):
        curves = {name: curve(rows, metric) for name, rows in metrics.items()}
        if any(len(points) > 1 for points in curves.values()):
            panels.append(_panel(number, label, curves))
    learned = [index for index, rows in enumerate(metrics.values()) if rows]
    return Plot("Learning", "From the run folders, over environment steps, smoothed.", panels, learned)


def read_metrics(path: Path) -> list[dict[str, float]]:
    """Rows of a metrics file; empty without a file. Incomplete lines of a killed process are skipped."""
    rows = []
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
    for text in lines:
        try:
            row = json.loads(text)
        except json.JSONDecodeError:
            continue
        if isinstance(row, dict) and "step" in row:
            rows.append(row)
    return rows


def curve(rows: list[dict[str, float]], metric: str) -> Points:
    """Steps and values of a metric (k, 2), at most `MAX_POINTS` of them, each the mean of an interval."""
    pairs = [
        (row["step"], row[metric])
        for row in rows
        if isinstance(row.get(metric), int | float) and math.isfinite(row[metric])
    ]
    points = np.array(pairs, dtype=float).reshape(-1, 2)
    if len(points) <= MAX_POINTS:
        return points
    return np.array([part.mean(axis=0) for part in np.array_split(points, MAX_POINTS)])


def _panel(number: int, label: str, curves: Mapping[str, Points]) -> Markup:
    with Panel(f"learning-{number}") as panel:
        readings = []
        for index, (policy, points) in enumerate(curves.items()):
            panel.axes.plot(points[:, 0] / 1e6, points[:, 1], **line(index))
            readings += [
                Reading(step / 1e6, value, f"{policy}: {value:.3g}\nafter {step / 1e6:.3g} million steps")
                for step, value in points[:: max(1, len(points) // 80)].tolist()
            ]
        panel.axes.set(xlabel="environment steps, millions", title=label)
        return panel.svg(f"{label} over environment steps", readings)
