"""Handles a standard output that can no longer be written."""

import io
import os
import sys
from contextlib import suppress


def discard_output() -> None:
    """Discard buffered output of a stream that cannot be written."""
    with suppress(io.UnsupportedOperation, OSError):  # an output in memory; no free descriptor
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
