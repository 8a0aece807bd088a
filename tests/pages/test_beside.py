"""The page beside a training, in the process that serves it."""

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from notes import Notes

from footfall.common.errors import UserError
from footfall.pages import beside


def test_the_reason_of_its_end_is_reported_although_its_output_is_discarded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def watch(*_: object) -> None:
        print("a library's greeting")
        raise UserError("port 8080 is taken")

    monkeypatch.setattr("footfall.pages.walk.watch", watch)
    monkeypatch.setattr(beside, "end_with_parent", lambda: None)
    monkeypatch.setattr(os, "nice", lambda _: 0)
    beside._serve(tmp_path, "localhost", 8080)
    assert capsys.readouterr() == ("", "footfall: the page ended: port 8080 is taken\n")


class TestBeside:
    @pytest.fixture
    def log(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """Start and end of the process that serves the page."""
        log: list[Any] = []

        def context(kind: str) -> Any:
            log.append(kind)
            return SimpleNamespace(Process=lambda **how: log.append(how) or Notes(log, "process"))

        monkeypatch.setattr(beside.multiprocessing, "get_context", context)
        return log

    def test_it_ends_with_a_training_that_fails(self, log: list[Any]) -> None:
        with pytest.raises(ZeroDivisionError), beside.watched(Path("run"), "there", 123):
            raise ZeroDivisionError
        assert [each[1] for each in log[-2:]] == ["terminate", "join"]

    def test_it_serves_at_low_priority(self, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
        log: list[Any] = []
        monkeypatch.setattr("footfall.pages.walk.watch", lambda *given: log.append(given))
        monkeypatch.setattr(beside, "end_with_parent", lambda: None)
        monkeypatch.setattr(os, "nice", log.append)
        beside._serve(tmp_path, "there", 123)
        nice, (*given, stop) = log
        assert (nice, given) == (10, [tmp_path, "there", 123])
        assert stop.requested is False
