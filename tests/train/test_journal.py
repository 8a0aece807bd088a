"""A run's journal: the log, the display, and checkpoints that are due."""

import json
from types import SimpleNamespace
from typing import Any

import pytest

from footfall.common.errors import CannotWriteError
from footfall.train.runs import journal
from footfall.train.runs.folder import Run


@pytest.fixture
def result(run: Run, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A journal from the third iteration on, its clock and its output."""
    now = SimpleNamespace(s=50.0)
    monkeypatch.setattr(journal, "time", SimpleNamespace(monotonic=lambda: now.s))
    shown: list[Any] = []
    screen = SimpleNamespace(update=lambda *each: shown.append(each), say=shown.append)
    return SimpleNamespace(journal=journal.Journal(run, 2, screen), now=now, shown=shown, run=run)  # type: ignore[arg-type]


def test_an_iteration_is_logged_and_shown_by_its_steps_and_speed(result: SimpleNamespace) -> None:
    result.now.s += 2.0
    result.journal.log(3, {"reward/total": 1.0})
    result.now.s += 2.0
    result.journal.log(4, {"reward/total": 2.0, "episode/length_s": 3.0})
    assert result.shown == [
        (768, 128.0, {"reward/total": 1.0}), (1024, 128.0, {"reward/total": 2.0,
        "episode/length_s": 3.0}),
    ]  # fmt: skip
    lines = [json.loads(line) for line in (result.run.folder / "metrics.jsonl").read_text().splitlines()]
    assert lines == [
        {"step": 768, "reward/total": 1.0, "speed/steps_per_s": 128.0},
        {"step": 1024, "reward/total": 2.0, "episode/length_s": 3.0, "speed/steps_per_s": 128.0},
    ]


def test_a_failed_checkpoint_is_reported_once_and_tried_again(result: SimpleNamespace) -> None:
    def refuse() -> None:
        raise CannotWriteError("the disk is full")

    result.now.s += 2.1  # the preset's interval is 2 s
    assert result.journal.checkpoint_due
    result.journal.save(refuse)
    assert not result.journal.checkpoint_due
    result.journal.save(refuse)
    result.journal.save(lambda: None)
    result.journal.save(lambda: None)
    assert result.shown == [
        "the disk is full; training continues and tries again",
        "checkpoint can be written again",
    ]


def test_a_checkpoint_is_due_an_interval_after_the_last_one(result: SimpleNamespace) -> None:
    due = []
    for result.now.s in (51.9, 52.1, 53.0, 54.0, 54.2):  # the preset's interval is 2 s
        due.append(result.journal.checkpoint_due)
        if result.now.s == 52.1:
            result.journal.save(lambda: None)
    assert due == [False, True, False, False, True]
