"""Height scans from a mapping program in UDP datagrams (sent with `udp_client.UdpHeightScan`).

The sender gives the age of a scan at the time of sending, so the two computers' clocks are not compared. The
network's delay is not included.
"""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.height_scan import Scanned
from footfall.operate.datagrams import answered_datagrams
from footfall.operate.udp import MAX_SENDERS, MIN_TOKEN_CHARS, UdpConfig
from footfall.operate.udp_client import MAX_DATAGRAM_BYTES, SCAN, SCAN_PORT, TOKEN, unpack

MAX_AGE_S = 60.0


class TimedScan(NamedTuple):
    """A scan with its time by this computer's monotonic clock."""

    taken_s: float
    heights: np.ndarray  # (points,)


class UdpScans:
    """Keeps the newest scan from senders with the token."""

    def __init__(self, token: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._token, self._clock = token, clock
        self._newest: TimedScan | None = None
        # Number of each sender's latest datagram, the sender that has been silent longest first.
        self._last_numbers: dict[str, int] = {}

    def receive(self, datagram: bytes) -> str:
        """Read a datagram; returns why it is refused, or an empty string."""
        content = unpack(datagram, self._token, SCAN)
        if content is None:
            return "not a height scan with the right token"
        sender, number, age_s = (content.get(key) for key in ("sender", "number", "age_s"))
        if not isinstance(sender, str) or not isinstance(number, int):
            return "sender and number are missing"
        if number <= self._last_numbers.get(sender, -1):
            return "an old datagram"
        if isinstance(age_s, bool) or not isinstance(age_s, int | float) or not 0.0 <= age_s <= MAX_AGE_S:
            return f"age_s is not a number from 0 to {MAX_AGE_S:g}"
        heights = _heights(content.get("heights"))
        if heights is None:
            return "heights is not a list of numbers, with null for unknown ones"
        self._remember(sender, number)
        self._newest = TimedScan(self._clock() - age_s, heights)
        return ""

    def _remember(self, sender: str, number: int) -> None:
        """Note a sender's latest number. A mapping program that restarts is a new sender each time."""
        self._last_numbers.pop(sender, None)
        self._last_numbers[sender] = number
        if len(self._last_numbers) > MAX_SENDERS:
            del self._last_numbers[next(iter(self._last_numbers))]

    def answer(self, datagram: bytes) -> bytes:
        """Read a datagram; there is no reply."""
        self.receive(datagram)
        return b""

    def newest(self, now_us: int) -> Scanned | None:
        """The newest scan, with its time by the loop's clock."""
        newest = self._newest
        if newest is None:
            return None
        age_s = self._clock() - newest.taken_s
        return Scanned(now_us - round(1e6 * age_s), newest.heights)


def _heights(content: Any) -> np.ndarray | None:
    if not isinstance(content, list):
        return None
    numbers = [np.nan if each is None else each for each in content]
    if any(isinstance(each, bool) or not isinstance(each, int | float) for each in numbers):
        return None
    try:
        return np.array(numbers, dtype=float)
    except OverflowError:  # an integer larger than all floating-point numbers
        return None


@contextmanager
def scans_by_udp(address: str = "") -> Iterator[UdpScans]:
    """Receive height scans while the context is open.

    Args:
        address: HOST:PORT to listen on; by default only from this computer.

    Raises:
        UserError: the address cannot be used, or the token is missing or too short to be a secret.
    """
    default = f"127.0.0.1:{SCAN_PORT}"
    try:
        host, port = UdpConfig(address or default).socket_address
    except ValueError:
        reason = f"address is HOST:PORT, such as {default}, not '{address}'"
        raise UserError(f"--height-scan udp: {reason}") from None
    token = os.environ.get(TOKEN, "")
    if len(token) < MIN_TOKEN_CHARS:
        raise UserError(
            f"--height-scan udp: set {TOKEN} to a secret of at least {MIN_TOKEN_CHARS} characters, which the"
            " sender of scans knows, too"
        )
    scans = UdpScans(token)
    with answered_datagrams((host, port), MAX_DATAGRAM_BYTES, scans.answer, "--height-scan udp"):
        yield scans
