"""Checkpoints: written whole or not at all, the newest few kept."""

from pathlib import Path

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
    for other in ({"a": jnp.zeros(4), "b": jnp.int32(0)}, {"a": jnp.zeros(3, jnp.int32), "b": jnp.int32(0)}):
        with pytest.raises(UserError):
            checkpoint.restore(path, other)


def test_three_are_kept_and_leftovers_of_a_killed_writer_are_deleted(tmp_path: Path) -> None:
    (tmp_path / ".00000001.ckpt.abc").touch()
    for iteration in (9, 10, 2, 100, 11):
        checkpoint.write(tmp_path, iteration, b"x")
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{k:08d}.ckpt" for k in (10, 11, 100)]
    assert checkpoint.latest(tmp_path) == tmp_path / "00000100.ckpt"
    assert checkpoint.latest(tmp_path / "none") is None


def test_a_checkpoint_makes_room_for_itself_but_keeps_one(disk: Path) -> None:
    state = {"weights": np.zeros(2**16, np.float32)}  # a quarter of the disk
    for iteration in range(1, 4):
        checkpoint.save(disk, iteration, state, np.zeros(1))
    fill(disk)
    checkpoint.save(disk, 4, state, np.zeros(1))
    assert [p.name for p in sorted(disk.glob("*.ckpt"))] == ["00000003.ckpt", "00000004.ckpt"]
    (disk / "filler").unlink()
    fill(disk)
    with pytest.raises(CannotWriteError, match="00000004"):
        checkpoint.save(disk, 5, {"weights": np.zeros(2**17, np.float32)}, np.zeros(1))
    assert [p.name for p in sorted(disk.iterdir())] == ["00000004.ckpt", "filler"]
