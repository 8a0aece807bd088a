"""Ending a child process that reads its standard input."""

import subprocess
from contextlib import suppress
from typing import Any


def end_by_input(process: "subprocess.Popen[Any]", patience_s: float) -> None:
    """Close a child's standard input, upon which it exits, and wait; kill it after `patience_s`."""
    assert process.stdin is not None
    assert process.stdout is not None
    with suppress(OSError):
        process.stdin.close()
    try:
        process.wait(patience_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    process.stdout.close()
