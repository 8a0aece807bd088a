"""Imports of the learning libraries, which may not be installed."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from threading import Thread

from footfall.common.collector import lasting_objects


@contextmanager
def learning_libraries() -> Iterator[None]:
    """Context in which to import `footfall.train.api` or another module that needs JAX.

    Raises:
        UserError: JAX or another library of the `train` extra is missing.
    """
    from footfall.common.installation import needs_extra  # imports more than `start_device` has time for

    with needs_extra("train", "training and export need"), lasting_objects():
        yield


def start_device() -> None:
    """Import JAX, then start its device in the background: a GPU takes a second or more.

    The first use of the device waits for it, and raises if it cannot start. Not for a process of a cluster,
    which must join the cluster first.
    """
    # Reserving most of a GPU's memory at once takes a second or two, longer than the rest of its start.
    os.environ.setdefault("XLA_PYTHON_CLIENT_PREALLOCATE", "false")
    Thread(target=_wake_driver, name="wake driver").start()
    # Imported here, not in the thread: at the same time as other imports this import would take twice as
    # long, and the device starts after it.
    with suppress(Exception), lasting_objects():  # the next use of JAX reports it
        import_module("jax.numpy")
    Thread(target=_first_operation, name="start device").start()


def _wake_driver() -> None:
    """Initialise CUDA, a third of a GPU's start; unlike an import it needs no lock of Python's."""
    if os.environ.get("JAX_PLATFORMS", "cuda") not in ("cuda", "gpu"):
        return
    with suppress(OSError, AttributeError):  # there is no NVIDIA driver
        ctypes.CDLL("libcuda.so.1").cuInit(0)


def _first_operation() -> None:
    with suppress(Exception), lasting_objects():  # the next use of JAX or the device reports it
        import jax.numpy

        from footfall.train.compilation_cache import use_compilation_cache

        use_compilation_cache()
        jax.numpy.zeros(1).block_until_ready()
