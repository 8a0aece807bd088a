"""Two processes train one policy: the first writes, both compute the same."""

import json
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.train import api, cluster
from footfall.train.progress import newest_checkpoint
from footfall.train.runs import checkpoint

PATIENCE_S = 420


def test_two_processes_train_one_run_that_one_process_continues(
    six_iterations: str, kept_programs: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with socket.socket() as free:
        free.bind(("localhost", 0))
        coordinator = f"localhost:{free.getsockname()[1]}"
    options = ("--preset", six_iterations, "--steps", "1024", "--out", "run", "--no-evaluate")
    command = (sys.executable, "-m", "footfall", "train", *options, "--coordinator", coordinator)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True}
    started = [
        subprocess.Popen((*command, "--processes", "2", "--process", index), cwd=tmp_path, **pipes)
        for index in "01"
    ]
    try:
        first, second = (process.communicate(timeout=PATIENCE_S)[0] for process in started)
    finally:
        for process in started:
            process.kill()
    assert [process.returncode for process in started] == [0, 0], first + second
    assert "exported" in first
    assert "exported" not in second

    folder = tmp_path / "run"
    lines = (folder / "metrics.jsonl").read_text().splitlines()
    assert [json.loads(line)["step"] for line in lines] == [256, 512, 768, 1024]
    assert (folder / "policy.onnx").is_file()
    assert checkpoint.latest(folder / "checkpoints") == folder / "checkpoints" / "00000004.ckpt"

    config = folder / "config.yaml"  # as long as the preset, so that a compiled program can be reused
    config.write_text(config.read_text().replace("total_steps: 1024", "total_steps: 1536"))
    api.resume(folder)
    assert "resuming from 00000004.ckpt" in capsys.readouterr().out
    assert checkpoint.latest(folder / "checkpoints") == folder / "checkpoints" / "00000006.ckpt"


def test_each_process_resumes_from_the_first_processs_checkpoint_or_not_at_all(
    whole_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened = api.open_run(whole_run)
    monkeypatch.setattr(cluster, "processes", lambda: 2)
    oldest = min(opened.checkpoints.iterdir())  # this process sees newer ones
    monkeypatch.setattr(cluster, "broadcast", lambda _: (int(oldest.stem),))
    assert newest_checkpoint(opened) == oldest
    monkeypatch.setattr(cluster, "broadcast", lambda _: (9,))
    with pytest.raises(UserError, match=r"\b0 .*00000009\.ckpt"):
        newest_checkpoint(opened)


def test_a_failure_in_one_process_is_reported_in_each(monkeypatch: pytest.MonkeyPatch) -> None:
    result: list[bool] = []

    def gathered(this: np.ndarray) -> np.ndarray:
        result.append(bool(this))
        return np.array([False, False, True])

    monkeypatch.setattr(cluster, "processes", lambda: 3)
    monkeypatch.setattr(cluster.multihost_utils, "process_allgather", gathered)
    with pytest.raises(UserError, match=r"\b2\b"), cluster.all_or_none():
        pass
    with pytest.raises(ValueError, match="mine"), cluster.all_or_none():
        raise ValueError("mine")
    assert result == [False, True]
    monkeypatch.setattr(cluster.multihost_utils, "broadcast_one_to_all", lambda values: values + 1)
    assert cluster.broadcast(3, 0) == (4, 1)
