"""Ending child processes: one that reads its standard input, and one whose parent is gone."""

import multiprocessing
import os
import signal
import subprocess
import threading
from contextlib import suppress
from typing import Any


def end_by_closing_input(process: "subprocess.Popen[Any]", timeout_s: float) -> None:
    """Close a child's standard input, upon which it exits, and wait; kill it after `timeout_s`."""
    assert process.stdin is not None
    assert process.stdout is not None
    with suppress(OSError):
        process.stdin.close()
    try:
        process.wait(timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    process.stdout.close()


def end_with_parent() -> None:
    """Let this process of `multiprocessing` get SIGTERM once its parent has ended, even if it was killed."""
    threading.Thread(target=_wait_for_parent, daemon=True).start()


def _wait_for_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)
