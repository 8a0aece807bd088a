"""A run's metrics, read while they grow."""

import os
from pathlib import Path

import numpy as np
import pytest

from footfall.pages.metrics_file import MetricsFile, thinned

TWO = '{"step": 10, "a": 1}\n{"step": 20, "a": 2}\n'


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "metrics.jsonl"


def curve(metrics: MetricsFile) -> list[list[float]]:
    return [part.tolist() for part in metrics.curve("a")]


def test_the_age_of_metrics_is_since_the_last_line(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert MetricsFile(path).age_s() is None
    path.write_text(TWO)
    os.utime(path, (1000.0, 2000.0))
    monkeypatch.setattr("footfall.pages.metrics_file.time.time", lambda: 2042.0)
    assert MetricsFile(path).age_s() == pytest.approx(42.0)


@pytest.mark.parametrize("line", ["", "{", "[1]", "7", '{"a": 1}', '{"step": null}', '{"step": "x"}'])
def test_an_invalid_line_is_ignored(path: Path, line: str) -> None:
    path.write_text(f'{{"step": 5, "a": 3}}\n{line}\n{TWO}')
    metrics = MetricsFile(path)
    assert metrics.refresh()
    assert curve(metrics) == [[5, 10, 20], [3, 1, 2]]


def test_curves_grow_with_the_file_by_whole_lines(path: Path) -> None:
    metrics = MetricsFile(path)
    assert not metrics.refresh()
    for text, steps in (
        (TWO, [10, 20]),
        (TWO + '{"step": 30, ', [10, 20]),
        (TWO + '{"step": 30, "a": 9}\n', [10, 20, 30]),
    ):
        path.write_text(text)
        metrics.refresh()
        assert curve(metrics)[0] == steps
    assert (metrics.refresh(), metrics.last_step) == (False, 30)


def test_a_shorter_file_is_read_from_its_beginning(path: Path) -> None:
    metrics = MetricsFile(path)
    path.write_text(TWO)
    metrics.refresh()
    path.write_text('{"step": 10, "a": 3}\n')
    assert metrics.refresh()
    assert (curve(metrics)[1], metrics.last_step) == ([3], 10)


def test_a_long_curve_is_thinned_except_at_its_ends() -> None:
    few = thinned(np.arange(10_000), 400)
    assert (len(few), few[0], few[-1]) == (400, 0, 9999)
    assert (np.diff(few) > 0).all()
