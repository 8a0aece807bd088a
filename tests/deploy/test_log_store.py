"""Automatic logs: the space that they take, and files that are never deleted."""

import os
from pathlib import Path

import numpy as np
import pytest
from deploy_policies import Hold

from footfall.common import held
from footfall.common.errors import UserError
from footfall.deploy.log import McapLog
from footfall.deploy.log_file import read_log
from footfall.deploy.log_store import LogStore
from footfall.deploy.receiver import MotorHealth
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot


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


def test_a_long_run_keeps_its_first_and_last_part(
    go1: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(held, "NAMESPACE", "footfall")  # as of the process that writes
    store = LogStore(tmp_path, 400_000)
    path = store.new_log("go1")
    log = McapLog(path, go1, Hold(go1), {}, may_wait=True, store=store)
    log.begin(0)
    rng = np.random.default_rng(0)
    health = MotorHealth(np.zeros(13), *np.zeros((3, 12)))
    ticks = 3000
    for tick in range(ticks):
        sensed = Sensed(*np.split(rng.normal(size=46), [3, 6, 10, 22, 34]))
        log.tick(2000 * tick, sensed, health, rng.normal(size=(5, 12)))
    assert log.close() == ""
    parts = sorted(tmp_path.iterdir(), key=lambda each: each.stat().st_mtime)
    assert parts[0] == path
    assert not (tmp_path / f"{path.stem}.part2.mcap").exists()
    assert sum(each.stat().st_size for each in parts) < 2 * store.max_bytes  # flushed less often in lockstep
    last = read_log(parts[-1])
    assert last.complete
    assert last.entries[-1].time_ns == 2_000_000 * (ticks - 1)
    for each in parts:
        found = read_log(each)
        assert found.metadata["robot"] == "go1"
        topics = {"/robot_description", "/tf_static", "/joint_states"}
        assert {entry.topic for entry in found.entries} >= topics
