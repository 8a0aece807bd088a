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
    """Context in which no other test of this machine has a robot on these buses."""
    with (Path(tempfile.gettempdir()) / "footfall-multicast.lock").open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


@contextmanager
def robot_on_multicast(*options: str) -> Iterator[None]:
    """Context with the robot on the buses; skips the test without multicast."""
    command = [sys.executable, "-m", "footfall.plant.serve", "--bus", "udp_multicast", *options]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with alone_on_multicast(), subprocess.Popen(command, **pipes, text=True) as server:  # type: ignore[call-overload]
        try:
            if not server.stdout.readline():  # it reports that it is ready
                pytest.skip(f"no multicast here: {server.communicate()[1].strip()}")
            yield
        finally:
            server.terminate()
