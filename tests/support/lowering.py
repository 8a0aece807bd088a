"""Shared MLIR contexts: JAX makes one for every program, a third of a small program's compilation time."""

import sys
import threading
from typing import Any

PROGRAMS = 200  # programs of one context; more would need much memory, because it keeps their constants


def share_contexts() -> None:
    """Programs that are compiled one after the other have one context, if JAX has been imported.

    While another thread runs, every program has a context of its own. JAX 0.11 shares contexts
    by itself.
    """
    try:
        mlir: Any = sys.modules["jax._src.interpreters.mlir"]
        make = mlir.make_ir_context
    except (KeyError, AttributeError):
        return
    threads = set(threading.enumerate())
    made: list[Any] = []

    def context() -> Any:
        if not threads.issuperset(threading.enumerate()):
            return make()
        if len(made) % PROGRAMS == 0:
            made[:] = [make()]
        made.append(made[-1])
        return made[-1]

    mlir.make_ir_context = context
