"""Output files: refused before a long run, or whole."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.common.outputs import check_outputs, write_json, write_text


def test_checking_leaves_nothing_behind(tmp_path: Path) -> None:
    check_outputs(tmp_path / "report.html", None)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=f"there is no folder {tmp_path / 'new'}"):
        check_outputs(tmp_path / "new" / "report.html")


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="is a folder"):
        check_outputs(tmp_path)


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"cannot write .*report\.json"):
        check_outputs(tmp_path / "file" / "report.json")


def test_checking_leaves_an_older_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    path.write_text("old")
    check_outputs(path)
    assert path.read_text() == "old"


def test_writing_replaces_the_old_content_and_leaves_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    path.write_text("old")
    write_text(path, "new ✓")
    assert path.read_text(encoding="utf-8") == "new ✓"
    assert os.listdir(tmp_path) == ["old.json"]


def test_who_reads_while_it_is_written_sees_the_old_content(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "old.json"
    path.write_text("old")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(UserError, match="No space left"):
        write_text(path, "new")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["old.json"]


def test_numbers_that_json_does_not_know_become_null(tmp_path: Path) -> None:
    write_json(tmp_path / "a.json", {"a": [float("nan"), np.inf, -np.inf, 1.5], "b": np.array([np.nan, 2.0])})
    assert json.loads((tmp_path / "a.json").read_text()) == {"a": [None, None, None, 1.5], "b": [None, 2.0]}
