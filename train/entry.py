"""Imports of the learning libraries, which may not be installed."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Thread
from typing import Any

from footfall.common.collector import collector_paused
from footfall.common.installation import needs_extra


@contextmanager
def learning_libraries() -> Iterator[None]:
    """Context in which to import `footfall.train.api` or another module that needs JAX.

    Raises:
        UserError: JAX or another library of the `train` extra is missing.
    """
    with needs_extra("train", "training and export need"), collector_paused():
        yield


def start_device() -> None:
    """Start JAX's device in the background: a GPU takes seconds.

    The first use of the device waits for it, and raises if it cannot start. Not for a process of a cluster,
    which must join the cluster first.
    """
    with collector_paused(), suppress(ModuleNotFoundError):  # `learning_libraries` reports it
        import jax.numpy

        # Reserving most of a GPU's memory at once takes a second or two, longer than the rest of its start.
        os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
        from footfall.train.compilation_cache import use_compilation_cache

        use_compilation_cache()
        Thread(target=_first_operation, args=(jax.numpy.zeros,), name="start device").start()


def _first_operation(zeros: Callable[[int], Any]) -> None:
    with suppress(Exception):
        zeros(1).block_until_ready()
