"""The simulated robot in a process of its own, on python-can's multicast buses."""

import fcntl
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest


@contextmanager
def alone_on_multicast() -> Iterator[None]:
    """No other test's robot is on these buses meanwhile, whichever process on this machine runs it."""
    with (Path(tempfile.gettempdir()) / "footfall-multicast.lock").open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@contextmanager
def robot_on_multicast(*options: str) -> Iterator[None]:
    """The robot is there; the test is skipped where there is no multicast."""
    command = [sys.executable, "-m", "footfall.plant.serve", "--bus", "udp_multicast", *options]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with alone_on_multicast(), subprocess.Popen(command, **pipes, text=True) as server:  # type: ignore[call-overload]
        try:
            if not server.stdout.readline():  # it reports that it is ready
                pytest.skip(f"no multicast here: {server.communicate()[1].strip()}")
            yield
        finally:
            server.terminate()
