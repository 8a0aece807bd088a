"""Checkpoints: written whole or not at all, the newest few kept."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from small_disk import fill

from footfall.common.errors import CannotWriteError, UserError
from footfall.train.runs import checkpoint

STATE = {"a": np.arange(3.0, dtype=np.float32), "b": np.int32(4)}


def test_written_values_are_read_back(tmp_path: Path) -> None:
    path = checkpoint.save(tmp_path / "c", 12, STATE, np.ones((2, 3), np.float32))
    assert path == tmp_path / "c" / "00000012.ckpt"
    shapes = {"a": jnp.zeros(3), "b": jnp.int32(0)}
    state, seen = checkpoint.restore(path, shapes)
    np.testing.assert_array_equal(state["a"], [0.0, 1.0, 2.0])
    assert int(state["b"]) == 4
    assert seen.shape == (2, 3)
    for other in (
        {"a": jnp.zeros(4), "b": jnp.int32(0)},
        {"a": jnp.zeros(3, jnp.int32), "b": jnp.int32(0)},
    ):
        with pytest.raises(UserError, match="shapes differ"):
            checkpoint.restore(path, other)


def test_three_are_kept_and_leftovers_of_a_killed_writer_are_deleted(tmp_path: Path) -> None:
    (tmp_path / ".00000001.ckpt.abc").touch()
    for iteration in (9, 10, 2, 100, 11):
        checkpoint.write(tmp_path, iteration, b"x")
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{k:08d}.ckpt" for k in (10, 11, 100)]
    assert checkpoint.latest(tmp_path) == tmp_path / "00000100.ckpt"
    assert checkpoint.latest(tmp_path / "none") is None


def test_the_last_good_one_is_named_on_failure(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    checkpoint.write(tmp_path, 3, b"x")

    def refuse(*_: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(checkpoint, "write_atomically", refuse)
    with pytest.raises(
        CannotWriteError, match=r"00000004.ckpt: Permission denied; the last good one is 00000003"
    ):
        checkpoint.write(tmp_path, 4, b"y")


def test_a_checkpoint_makes_room_for_itself_but_keeps_one(disk: Path) -> None:
    state = {"weights": np.zeros(2**16, np.float32)}  # a quarter of the disk
    for iteration in range(1, 4):
        checkpoint.save(disk, iteration, state, np.zeros(1))
    fill(disk)
    checkpoint.save(disk, 4, state, np.zeros(1))
    assert [p.name for p in sorted(disk.glob("*.ckpt"))] == ["00000003.ckpt", "00000004.ckpt"]
    (disk / "filler").unlink()
    fill(disk)
    with pytest.raises(CannotWriteError, match="the last good one is 00000004"):
        checkpoint.save(disk, 5, {"weights": np.zeros(2**17, np.float32)}, np.zeros(1))
    assert [p.name for p in sorted(disk.iterdir())] == ["00000004.ckpt", "filler"]


# Kills its own process at each line of saving a checkpoint in turn, and in the middle of the file's content.
KILL_ANYWHERE = """
import os, resource, shutil, signal, sys
from itertools import count
from pathlib import Path
import numpy as np
from footfall.common import files
from footfall.train.runs import checkpoint

folder = Path(sys.argv[1])
OURS = {checkpoint.__file__, files.__file__}
state = {"weights": np.zeros(4)}

def content(iteration):
    return {"weights": np.full(10_000, float(iteration))}

def killed_at(line):
    def trace(frame, event, _):
        nonlocal line
        if frame.f_code.co_filename not in OURS:
            return None
        if event == "line":
            line -= 1
            if line == 0:
                os.kill(os.getpid(), signal.SIGKILL)
        return trace
    sys.settrace(trace)

def killed_in_the_content(_):
    signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))

def survives(arm, line):
    shutil.rmtree(folder, ignore_errors=True)
    for iteration in range(1, 4):
        checkpoint.save(folder, iteration, content(iteration), np.zeros(1))
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        arm(line)
        checkpoint.save(folder, 4, content(4), np.zeros(1))
        os._exit(0)
    _, status = os.waitpid(child, 0)
    newest = checkpoint.latest(folder)
    assert newest.stem in {"00000003", "00000004"}, newest
    for path in folder.glob("*.ckpt"):
        restored, _ = checkpoint.restore(path, content(0))
        assert (restored["weights"] == int(path.stem)).all(), path
    checkpoint.save(folder, 5, content(5), np.zeros(1))
    assert len(list(folder.iterdir())) == 3, list(folder.iterdir())
    return os.WIFEXITED(status)

assert not survives(killed_in_the_content, 0)
lines = next(line for line in count(1) if survives(killed_at, line))
print(lines - 1)
"""


def test_a_checkpoint_is_complete_if_its_writer_is_killed_at_any_line(tmp_path: Path) -> None:
    command = [sys.executable, "-c", KILL_ANYWHERE, str(tmp_path / "checkpoints")]
    done = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 30, "lines at which it was killed"
