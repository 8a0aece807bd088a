"""Training over several hosts: processes that JAX joins into one machine of many devices.

Every process computes the same iterations; process 0 leads: it alone writes, shows, and decides when to
stop and when to keep a checkpoint. Without a cluster there is one process, and it leads.
"""

from typing import Any

import jax
import numpy as np
from jax.experimental import multihost_utils

from robots.errors import UserError


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
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0]
        raise UserError(f"cannot join the training at {coordinator}: {reason}") from None


def processes() -> int:
    """How many processes train together."""
    return jax.process_count()


def leads() -> bool:
    """Whether this process is the one that writes."""
    return jax.process_index() == 0


def wait_for_all(what: str) -> None:
    """Return when every process has come so far."""
    if processes() > 1:
        multihost_utils.sync_global_devices(what)


def as_the_leader_says(*flags: bool) -> tuple[bool, ...]:
    """The leader's flags, in every process."""
    if processes() == 1:
        return flags
    said = multihost_utils.broadcast_one_to_all(np.array(flags))
    return tuple(bool(flag) for flag in said)


def on_the_host(tree: Any) -> Any:
    """Whole arrays on the host, in every process; all must ask for them."""
    if processes() == 1:
        return jax.device_get(tree)
    return multihost_utils.process_allgather(tree, tiled=True)
