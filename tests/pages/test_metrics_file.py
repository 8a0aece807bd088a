"""A run's metrics, read while they grow."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from footfall.pages.metrics_file import MetricsFile, thinned


class TestMetricsFile:
    def test_its_age_is_since_it_grew(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = tmp_path / "metrics.jsonl"
        metrics = MetricsFile(path)
        assert metrics.age_s() is None
        path.write_text('{"step": 1}\n')
        os.utime(path, (1000.0, 2000.0))
        monkeypatch.setattr("footfall.pages.metrics_file.time.time", lambda: 2042.0)
        assert metrics.age_s() == pytest.approx(42.0)

    @pytest.mark.parametrize("line", ["", "{", "[1]", "7", '{"a": 1}', '{"step": null}', '{"step": "x"}'])
    def test_a_line_that_is_no_row_is_passed_over(self, tmp_path: Path, line: str) -> None:
        path = tmp_path / "metrics.jsonl"
        path.write_text(f'{{"step": 1, "a": 3}}\n{line}\n{{"step": 2, "a": 4}}\n')
        metrics = MetricsFile(path)
        assert metrics.refresh()
        assert [part.tolist() for part in metrics.curve("a")] == [[1, 2], [3, 4]]

    def test_a_shorter_file_is_read_from_its_beginning(self, tmp_path: Path) -> None:
        path = tmp_path / "metrics.jsonl"
        metrics = MetricsFile(path)
        path.write_text('{"step": 10, "a": 1}\n{"step": 20, "a": 2}\n')
        metrics.refresh()
        path.write_text('{"step": 10, "a": 3}\n')
        assert metrics.refresh()
        assert (metrics.curve("a")[1].tolist(), metrics.last_step) == ([3], 10)
        assert not metrics.refresh()

    @pytest.fixture
    def path(self, tmp_path: Path) -> Path:
        return tmp_path / "metrics.jsonl"

    def write(self, path: Path, *rows: dict, rest: str = "", mode: str = "a") -> None:
        with path.open(mode) as file:
            file.write("".join(json.dumps(row) + "\n" for row in rows) + rest)

    def test_curves_grow_with_the_file(self, path: Path) -> None:
        metrics = MetricsFile(path)
        assert not metrics.refresh()
        self.write(path, {"step": 10, "a": 1.0})
        assert metrics.refresh()
        assert [x.tolist() for x in metrics.curve("a")] == [[10], [1]]
        assert not metrics.refresh()
        self.write(path, {"step": 20, "a": 2.0}, {"step": 30, "a": 3.0})
        assert metrics.refresh()
        assert [x.tolist() for x in metrics.curve("a")] == [[10, 20, 30], [1, 2, 3]]
        assert metrics.last_step == 30

    def test_half_a_line_waits_for_its_other_half(self, path: Path) -> None:
        metrics = MetricsFile(path)
        self.write(path, {"step": 10, "a": 1.0}, rest='{"step": 20, ')
        metrics.refresh()
        assert metrics.last_step == 10
        self.write(path, rest='"a": 2.0}\n')
        assert metrics.refresh()
        assert metrics.curve("a")[1].tolist() == [1, 2]

    def test_a_long_curve_is_thinned_between_its_ends(self) -> None:
        few = thinned(np.arange(10_000), 400)
        assert len(few) == 400
        assert (few[0], few[-1]) == (0, 9999)
        assert (np.diff(few) > 0).all()
        assert thinned(np.arange(5), 400).tolist() == [0, 1, 2, 3, 4]
