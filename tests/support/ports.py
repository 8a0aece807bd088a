"""TCP ports of this machine."""

import socket
import time


def free_port() -> int:
    """A port without a listener."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return int(probe.getsockname()[1])


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("localhost", port)) == 0


def wait_until_served(port: int, served: bool = True) -> None:
    """Wait at most 120 s until a server is there, or gone."""
    end = time.monotonic() + 120.0
    while listens(port) is not served:
        assert time.monotonic() < end
        time.sleep(0.05)
