"""Standard output that can no longer be written."""

import io
import os
import sys
from contextlib import suppress


def discard_output() -> None:
    """Discard what is still buffered for an output that cannot take it."""
    with suppress(io.UnsupportedOperation, OSError):  # an output in memory; no descriptor is left
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, sys.stdout.fileno())
        os.close(null)
