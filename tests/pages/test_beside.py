"""The page beside a training, in the process that serves it."""

import os
from pathlib import Path

import pytest

from footfall.common.errors import UserError
from footfall.pages import beside


def test_the_reason_for_the_pages_end_is_reported_although_its_output_is_discarded(
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
