"""Training over several hosts: processes that JAX joins into one machine of many devices.

Every process computes the same iterations. Only process 0, the main process, writes, shows, and decides
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
    """Wait until all processes have joined; must be called before any other function of JAX.

    Args:
        coordinator: HOST:PORT of process 0, or "auto" under Slurm, MPI or Kubernetes.
        processes: number of processes; not with "auto".
        process: index of this process, from 0; not with "auto".

    Raises:
        UserError: the processes cannot be joined.
    """
    try:
        if coordinator == "auto":
            jax.distributed.initialize()
        else:
            jax.distributed.initialize(coordinator, processes, process)
    except (ValueError, RuntimeError) as error:
        raise UserError(f"cannot join the training at {coordinator}: {_first_line(error)}") from None


def devices() -> list[jax.Device]:
    """The devices of all processes; the first call starts JAX's back end.

    Raises:
        UserError: the back end cannot start, for example after a GPU was lost.
    """
    try:
        return jax.devices()
    except RuntimeError as error:
        raise UserError(f"no device to compute on: {_first_line(error)}") from None


def _first_line(error: Exception) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0]


def processes() -> int:
    """Number of processes that train together; raises as `devices`."""
    devices()
    return jax.process_count()


def is_main_process() -> bool:
    """Whether this is process 0, which writes; raises as `devices`."""
    devices()
    return jax.process_index() == 0


@contextmanager
def all_or_none() -> Iterator[None]:
    """A step of every process; if it fails in one, the training ends in all of them.

    Otherwise the others would wait for the failed process.

    Raises:
        UserError: it failed in another process, which reports the reason.
    """
    try:
        yield
    except Exception:
        _which_failed(True)
        raise
    failed = _which_failed(False)
    if failed:
        raise UserError(f"process {failed[0]} failed: see its output")


def _which_failed(failed_here: bool) -> list[int]:
    """Indices of the processes that failed, the same list in every process."""
    if processes() == 1:
        return []
    failed = multihost_utils.process_allgather(np.array(failed_here))
    return [int(process) for process in np.flatnonzero(failed)]


def broadcast(*values: int) -> tuple[int, ...]:
    """Process 0's values, in every process."""
    if processes() == 1:
        return values
    received = multihost_utils.broadcast_one_to_all(np.array(values, np.int32))
    return tuple(int(value) for value in received)


def gather(tree: Any) -> Any:
    """Whole arrays on the host, in every process; every process must call it."""
    if processes() == 1:
        return jax.device_get(tree)
    return multihost_utils.process_allgather(tree, tiled=True)
