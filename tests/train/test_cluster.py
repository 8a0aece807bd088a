"""Two processes train one policy: the first writes, both compute the same."""

import json
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("jax")

import jax
import numpy as np

from footfall.common.errors import UserError
from footfall.train import api, cluster
from footfall.train.runs import checkpoint

PATIENCE_S = 420


def start(folder: Path, process: int, *options: str) -> subprocess.Popen[str]:
    arguments = ["train", *options, "--no-evaluate", "--processes", "2", "--process", str(process)]
    return subprocess.Popen(
        [sys.executable, "-m", "footfall", *arguments],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def both(folder: Path, *options: str) -> list[tuple[int, str]]:
    """Exit status and output of each process."""
    with socket.socket() as free:
        free.bind(("localhost", 0))
        coordinator = f"localhost:{free.getsockname()[1]}"
    started = [start(folder, process, "--coordinator", coordinator, *options) for process in (0, 1)]
    try:
        outputs = [process.communicate(timeout=PATIENCE_S)[0] for process in started]
    finally:
        for process in started:
            process.kill()
    return [(process.returncode, output) for process, output in zip(started, outputs, strict=True)]


@pytest.fixture(scope="module")
def run(six_iterations: str, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[tuple[int, str]]]:
    folder = tmp_path_factory.mktemp("cluster")
    return folder / "run", both(folder, "--preset", six_iterations, "--steps", "1024", "--out", "run")


def test_both_processes_end_well_and_the_first_one_speaks(run: tuple[Path, list[tuple[int, str]]]) -> None:
    _, ((status, said), (other_status, other_said)) = run
    assert (status, other_status) == (0, 0), said + other_said
    assert "exported" in said
    assert "exported" not in other_said


def test_the_run_is_one_whole_run(run: tuple[Path, list[tuple[int, str]]]) -> None:
    folder, _ = run
    lines = [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == [256, 512, 768, 1024]
    assert (folder / "policy.onnx").is_file()
    assert [path.name for path in sorted((folder / "checkpoints").iterdir())][-1] == "00000004.ckpt"


def test_it_goes_on_in_one_process_as_well(
    run: tuple[Path, list[tuple[int, str]]], kept_programs: None, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, _ = run
    config = folder / "config.yaml"  # as long as the preset, whose program others have compiled
    config.write_text(config.read_text().replace("total_steps: 1024", "total_steps: 1536"))
    api.resume(folder)
    assert "resuming from 00000004.ckpt" in capsys.readouterr().out
    assert checkpoint.latest(folder / "checkpoints") == folder / "checkpoints" / "00000006.ckpt"


def test_all_end_where_the_first_one_fails(run: tuple[Path, list[tuple[int, str]]]) -> None:
    folder, _ = run
    (status, said), (other_status, other_said) = both(folder.parent, "--preset", "smoke", "--out", "run")
    assert (status, other_status) == (2, 2), said + other_said
    assert "run holds a run already" in said
    assert "process 0 failed: see its output" in other_said


def test_each_resumes_from_the_checkpoint_of_the_first_one_or_not_at_all(
    run: tuple[Path, list[tuple[int, str]]], monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = api.open_run(run[0])
    monkeypatch.setattr(cluster, "processes", lambda: 2)
    oldest = min(opened.checkpoints.iterdir())  # this process sees newer ones
    monkeypatch.setattr(cluster, "broadcast", lambda _: (int(oldest.stem),))
    assert api._newest_checkpoint(opened) == oldest
    monkeypatch.setattr(cluster, "broadcast", lambda _: (9,))
    with pytest.raises(UserError, match=r"process 0 resumes from .*00000009\.ckpt"):
        api._newest_checkpoint(opened)


def test_joining_hands_on_who_this_is(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Any] = []
    monkeypatch.setattr(jax.distributed, "initialize", lambda *each: given.append(each))
    cluster.join("host:1", 4, 2)
    cluster.join("auto")
    assert given == [("host:1", 4, 2), ()]

    def fail(*_: Any) -> None:
        raise RuntimeError("no such host\nand more")

    monkeypatch.setattr(jax.distributed, "initialize", fail)
    with pytest.raises(UserError, match=r"at host:1: no such host$"):
        cluster.join("host:1", 4, 2)


def test_what_another_process_fails_at_is_told_in_each(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[bool] = []

    def gathered(this: np.ndarray) -> np.ndarray:
        told.append(bool(this))
        return np.array([False, False, True])

    monkeypatch.setattr(cluster, "processes", lambda: 3)
    monkeypatch.setattr(cluster.multihost_utils, "process_allgather", gathered)
    with pytest.raises(UserError, match="process 2 failed"), cluster.all_or_none():
        pass
    with pytest.raises(ValueError, match="mine"), cluster.all_or_none():
        raise ValueError("mine")
    assert told == [False, True]
    monkeypatch.setattr(cluster.multihost_utils, "broadcast_one_to_all", lambda values: values + 1)
    assert cluster.broadcast(3, 0) == (4, 1)
