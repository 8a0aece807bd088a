"""Follows the metrics of a run that may still be training."""

import json
import math
import time
from pathlib import Path

import numpy as np


class MetricsFile:
    """Reads new rows of metrics.jsonl; its last line may still be incomplete."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._offset = 0
        self._rows: dict[int, dict[str, float]] = {}  # by environment step

    @property
    def last_step(self) -> int:
        """Environment steps at the newest line; 0 before the first."""
        return max(self._rows, default=0)

    def age_s(self) -> float | None:
        """Time since the file last grew, s; None without a file."""
        try:
            return time.time() - self._path.stat().st_mtime
        except FileNotFoundError:
            return None

    def refresh(self) -> bool:
        """Read new lines; returns whether there were any."""
        try:
            with self._path.open("rb") as file:
                if self._path.stat().st_size < self._offset:  # a resumed run deletes steps
                    self._offset = 0
                    self._rows.clear()
                file.seek(self._offset)
                complete, newline, _ = file.read().rpartition(b"\n")
        except FileNotFoundError:
            return False
        self._offset += len(complete) + len(newline)
        for line in complete.splitlines():
            try:
                row = json.loads(line)
                self._rows[int(row["step"])] = row
            except (ValueError, KeyError, TypeError):
                continue  # an incomplete line of a killed process
        return bool(complete)

    def curve(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Environment steps and a metric's finite values, each (k,), in order; empty if it has none."""
        points = [
            (step, value)
            for step, row in sorted(self._rows.items())
            if isinstance(value := row.get(name), int | float) and math.isfinite(value)
        ]
        steps, values = np.array(points, dtype=float).reshape(-1, 2).T
        return steps, values


def thinned(values: np.ndarray, max_count: int) -> np.ndarray:
    """At most `max_count` of the values (k,), evenly spaced, including the first and the last."""
    if len(values) <= max_count:
        return values
    return values[np.linspace(0, len(values) - 1, max_count).round().astype(int)]
