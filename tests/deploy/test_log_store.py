"""Automatic logs: the space that they take, and files that are never deleted."""

import os
from pathlib import Path

import pytest

from footfall.common.errors import UserError
from footfall.deploy.log_store import LogStore


def old_log(folder: Path, name: str, size: int, age: int) -> Path:
    path = folder / name
    path.write_bytes(bytes(size))
    os.utime(path, (1e9 - age, 1e9 - age))
    return path


def test_oldest_logs_make_room_and_nothing_else_does(tmp_path: Path) -> None:
    mine = old_log(tmp_path, "walk.mcap", 5000, age=99)
    link = tmp_path / "go1-20200101-000000-1.mcap"
    link.symlink_to(mine)
    oldest, older, new = (
        old_log(tmp_path, f"go1-2026010{day}-120000-{7 * day}.mcap", 400, age=9 - day) for day in (1, 2, 3)
    )
    path = LogStore(tmp_path, 1000).new_log("go1")
    assert path.parent == tmp_path
    assert not path.exists()
    assert [each.exists() for each in (mine, link, oldest, older, new)] == [True, True, False, True, True]


def test_a_folder_that_cannot_be_made_is_noted(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(UserError, match="--log FILE"):
        LogStore(tmp_path / "file" / "logs", 1000).new_log("go1")
