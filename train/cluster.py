"""Training over several hosts: processes that JAX joins into one machine of many devices.

Every process computes the same iterations; process 0 is the main one: it alone writes, shows, and decides
when to stop and when to save a checkpoint. Without a cluster there is one process, the main one.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import jax
import numpy as np
from jax.experimental import multihost_utils

from footfall.common.errors import UserError


def join(coordinator: str, processes: int | None = None, process: int | None = None) -> None:
    """Wait until all processes are there; must come before anything else of JAX.

    Args:
        coordinator: HOST:PORT of process 0, or "auto": what Slurm, MPI or Kubernetes says.
        processes: how many there are; not with "auto".
        process: which of them this is, from 0; not with "auto".

    Raises:
        UserError: the cluster cannot be made of what was given.
    """
    try:
        if coordinator == "auto":
            jax.distributed.initialize()
        else:
            jax.distributed.initialize(coordinator, processes, process)
    except (ValueError, RuntimeError) as error:
        raise UserError(f"cannot join the training at {coordinator}: {_first_line(error)}") from None


def devices() -> list[jax.Device]:
    """The devices of all processes; whoever asks first starts JAX's back end.

    Raises:
        UserError: it cannot start, as after a GPU was lost.
    """
    try:
        return jax.devices()
    except RuntimeError as error:
        raise UserError(f"no device to compute on: {_first_line(error)}") from None


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def processes() -> int:
    """How many processes train together; raises as `devices`."""
    devices()
    return jax.process_count()


def is_main_process() -> bool:
    """Whether this is process 0, the one that writes; raises as `devices`."""
    devices()
    return jax.process_index() == 0


@contextmanager
def all_or_none() -> Iterator[None]:
    """A step that every process takes, which ends the training in all of them if it fails in one.

    Otherwise the others would wait for the one that failed.

    Raises:
        UserError: it failed in another process, whose own error says why.
    """
    try:
        yield
    except Exception:
        _which_failed(True)
        raise
    others = _which_failed(False)
    if others:
        raise UserError(f"process {others[0]} failed: see its output")


def _which_failed(this: bool) -> list[int]:
    """The processes that failed, in each of them."""
    if processes() == 1:
        return []
    failed = multihost_utils.process_allgather(np.array(this))
    return [int(process) for process in np.flatnonzero(failed)]


def broadcast(*values: int) -> tuple[int, ...]:
    """Process 0's values, in every process."""
    if processes() == 1:
        return values
    received = multihost_utils.broadcast_one_to_all(np.array(values, np.int32))
    return tuple(int(value) for value in received)


def gather(tree: Any) -> Any:
    """Whole arrays on the host, in every process; all must ask for them."""
    if processes() == 1:
        return jax.device_get(tree)
    return multihost_utils.process_allgather(tree, tiled=True)
