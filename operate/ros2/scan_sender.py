"""Sends height scans from a bridge process to the run. Uses only the standard library."""

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress

from footfall.operate.udp_client import TOKEN, UdpHeightScan


@contextmanager
def scan_sender(port: int) -> Iterator[Callable[[Iterable[float]], None]]:
    """Yield a function that sends a scan's heights to a port of this computer; its age counts from now."""
    with UdpHeightScan("127.0.0.1", os.environ[TOKEN], port) as scans:

        def send(heights: Iterable[float]) -> None:
            with suppress(OSError):  # the run has just ended, or the scan is too large for a datagram
                scans.send(heights)

        yield send
