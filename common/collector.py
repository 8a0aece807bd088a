"""Pauses Python's garbage collector while many long-lived objects are created."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collector_paused() -> Iterator[None]:
    """Context without garbage collection, for imports of JAX and for tracing."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@contextmanager
def lasting_objects() -> Iterator[None]:
    """Context for imports: their objects last as long as the process, so the collector never looks at them.

    The half million objects of JAX and its libraries would otherwise cost a start several tenths of a second.
    """
    with collector_paused():
        yield
        gc.freeze()
