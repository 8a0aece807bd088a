"""The display of a training where there is no terminal: plain lines."""

import io
from types import SimpleNamespace

import pytest
from rich.console import Console
from training_metrics import METRICS

from footfall.train.runs import display


def test_a_line_has_progress_speed_and_quality(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line is printed every five seconds, and at the end."""
    now, out = [100.0], io.StringIO()
    monkeypatch.setattr(display, "time", SimpleNamespace(monotonic=lambda: now[0]))
    shown = display.Display(2000, Console(file=out, width=300))
    counts = []
    for now[0], steps in ((100.0, 500), (104.9, 600), (105.1, 700), (105.2, 2048)):
        shown.update(steps, 250.0, METRICS)
        counts.append(out.getvalue().count("\n"))
    assert counts == [1, 1, 2, 3]
    first, _, last = out.getvalue().splitlines()
    facts = ("500 of 2,000 steps", "250 per s", "6 s", "reward 1.50", "2.0 s", "0.250 m/s", "0.500 rad/s")
    assert [fact for fact in facts if fact not in first] == []
    assert "2,000 of 2,000 steps" in last
