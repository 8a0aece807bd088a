"""The display of a training: a live table on a terminal, plain lines elsewhere."""

import io
from types import SimpleNamespace
from typing import ClassVar

import pytest
from rich.console import Console

from footfall.train.runs import display
from footfall.train.runs.display import Display


class TestLines:
    METRICS: ClassVar = {
        "reward/total": 1.5, "reward/b": 0.25, "reward/a": -0.002, "tracking/linear_error_m_s": 0.1234,
        "tracking/yaw_error_rad_s": 0.5678, "episode/length_s": 12.34, "learning/kl": 0.0, "other/x": 9.0,
        "learning/policy_dist_mean": 7.0,
    }  # fmt: skip

    def plain(self, total: int = 1000) -> tuple[Display, io.StringIO]:
        out = io.StringIO()
        return Display(total, Console(file=out, width=300)), out

    def test_a_line_has_progress_speed_and_quality(self) -> None:
        shown, out = self.plain(2000)
        shown.update(500, 250.0, self.METRICS)
        assert out.getvalue() == (
            "500 of 2,000 steps, 250 per s, 6 s left, reward 1.50, episode 12.3 s,"
            " error 0.123 m/s, 0.568 rad/s\n"
        )
        without = {name: value for name, value in self.METRICS.items() if name != "episode/length_s"}
        shown.update(2048, 0.5, without)  # the last is always shown, even right after another
        last = out.getvalue().splitlines()[1]
        assert last.startswith("2,000 of 2,000 steps, 0 per s, 0 s left, reward 1.50, error 0.123 m/s")

    def test_lines_come_every_few_seconds(self, monkeypatch: pytest.MonkeyPatch) -> None:
        now = [100.0]
        monkeypatch.setattr(display, "time", SimpleNamespace(monotonic=lambda: now[0]))
        shown, out = self.plain()
        counts = []
        for now[0] in (100.0, 104.9, 105.1, 110.0, 110.2):
            shown.update(10, 1.0, self.METRICS)
            counts.append(out.getvalue().count("\n"))
        assert counts == [1, 1, 2, 2, 3]
