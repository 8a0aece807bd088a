"""A run's journal: the log, the display, and checkpoints that are due."""

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
    screen = SimpleNamespace(update=lambda *each: shown.append(each), report=shown.append)
    return SimpleNamespace(journal=journal.Journal(run, 2, screen), now=now, shown=shown, run=run)  # type: ignore[arg-type]


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
