"""The way into the learning wing, which may not be installed."""

import io
from collections.abc import Callable
from contextlib import redirect_stdout, suppress
from threading import Thread
from types import ModuleType
from typing import Any

from footfall.common.collector import collector_paused
from footfall.common.installation import needs_extra


def learning_wing() -> ModuleType:
    """`footfall.train.api`, once it is needed.

    Raises:
        UserError: JAX or another library of the `train` extra is missing.
    """
    # MJX announces on stdout that it goes without Warp, as it should.
    with (
        needs_extra("train", "training and export need"),
        collector_paused(),
        redirect_stdout(io.StringIO()),
    ):
        from footfall.train import api
    return api


def start_device() -> None:
    """Begin to start the device that JAX will use, beside what comes next: a GPU takes seconds.

    Whoever asks for the device then waits for it, and hears why it cannot be had. Not for a process of a
    cluster, which has to join that first.
    """
    with collector_paused(), suppress(ModuleNotFoundError):  # which `learning_wing` reports
        import jax.numpy

        Thread(target=_first_operation, args=(jax.numpy.zeros,), name="start device").start()


def _first_operation(zeros: Callable[[int], Any]) -> None:
    with suppress(Exception):
        zeros(1).block_until_ready()
