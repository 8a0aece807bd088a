"""Checkpoints: the whole training state in one file, written whole or not at all."""

import errno
from pathlib import Path
from typing import Any

import jax
import numpy as np

from footfall.common.errors import CannotWriteError, UserError
from footfall.common.files import write_atomically
from footfall.envs.old_settings import with_current_state

MAX_CHECKPOINTS = 3
DISK_FULL = (errno.ENOSPC, errno.EDQUOT)
SUFFIX = ".ckpt"


def save(folder: Path, iteration: int, state: Any, observations: Any) -> Path:
    """Write a checkpoint and drop all but the newest few.

    Args:
        folder: the run's checkpoints folder.
        iteration: iterations done.
        state: the training state, on any device.
        observations: some of the actor's observations, for the export's parity check.

    Raises:
        CannotWriteError: the disk is full or the folder cannot be written; the newest older checkpoint
            stays.
    """
    from flax import serialization  # takes long: imported while another thread reads compiled programs

    content = serialization.to_bytes(jax.device_get({"state": state, "observations": observations}))
    return write(folder, iteration, content)


def write(folder: Path, iteration: int, content: bytes) -> Path:
    """Write a checkpoint's content, as `save` does.

    Raises:
        CannotWriteError: as `save`.
    """
    file = path_of(folder, iteration)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for unfinished in folder.glob(f".*{SUFFIX}.*"):  # left by a process that was killed
            unfinished.unlink()
        _write(file, content)
    except OSError as error:
        newest = latest(folder)
        raise CannotWriteError(
            f"cannot write checkpoint {file}: {error.strerror};"
            f" the last good one is {newest.name if newest else 'none'}"
        ) from None
    _keep_newest(folder, MAX_CHECKPOINTS)
    return file


def _write(path: Path, content: bytes) -> None:
    """Write a file; on a full disk, delete all older checkpoints but one and try again."""
    try:
        write_atomically(path, content)
    except OSError as error:
        if error.errno not in DISK_FULL:
            raise
        _keep_newest(path.parent, 1)
        write_atomically(path, content)


def _keep_newest(folder: Path, count: int) -> None:
    for old in sorted(folder.glob(f"*{SUFFIX}"))[:-count]:
        old.unlink()


def path_of(folder: Path, iteration: int) -> Path:
    """Path of the checkpoint after this number of iterations."""
    return folder / f"{iteration:08d}{SUFFIX}"


def latest(folder: Path) -> Path | None:
    """The newest checkpoint of a run, or None."""
    return max(folder.glob(f"*{SUFFIX}"), default=None)


def restore(path: Path, state: Any) -> tuple[Any, np.ndarray]:
    """Read a checkpoint.

    Args:
        path: the file.
        state: a state of the same structure, or its shapes; values are not read.

    Returns:
        The state, and observations of the actor.

    Raises:
        UserError: the file is damaged or belongs to another configuration.
    """
    from flax import serialization

    try:
        content = serialization.msgpack_restore(path.read_bytes())
        restored = serialization.from_state_dict(state, with_current_state(content["state"]))
        observations = np.asarray(content["observations"])
        same = jax.tree.map(lambda a, b: a.shape == b.shape and a.dtype == b.dtype, state, restored)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        reason = " ".join(str(error).split())[:120]
        raise UserError(f"{path} is not a checkpoint of this run: {reason}") from None
    if not all(jax.tree.leaves(same)):
        raise UserError(f"{path} is not a checkpoint of this run: array shapes differ from config.yaml's")
    return restored, observations
