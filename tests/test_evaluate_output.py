"""Output files: refused before a long run, or whole."""

import os
from pathlib import Path

import pytest

from evaluate.output import check_writable, write_text
from robots.errors import UserError


def test_a_new_folder_is_made_and_nothing_is_left_in_it(tmp_path: Path) -> None:
    check_writable(tmp_path / "new" / "report.html", None)
    assert list((tmp_path / "new").iterdir()) == []


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="is a folder"):
        check_writable(tmp_path)


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UserError, match=r"cannot write .*report\.json"):
        check_writable(tmp_path / "file" / "report.json")


def test_checking_leaves_an_older_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    path.write_text("old")
    check_writable(path)
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
