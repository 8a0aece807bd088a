"""A small client for `--from udp`. It needs no other file, so it can be copied.

    from footfall.operate.udp_client import UdpSteering

    with UdpSteering("robot.local", token) as steering:
        while True:
            status = steering.send(velocity=[0.3, 0.0, 0.2])
            time.sleep(0.05)

A datagram is the HMAC-SHA256 (32 bytes) of direction and content with the token as its key, followed by the
content: JSON in UTF-8. A request has

    sender, number   a random name of the client, and an increasing number
    challenge        of the latest reply
    name             of the operator
    velocity, behaviour, policy, gait, settings    the request; what is omitted stays unchanged
    take_over        true: take control
    stop, damp       a reason: stop the robot; damp it at once

Velocities that are not renewed within 0.5 s count as zero.

`UdpHeightScan` is the client for `--height-scan udp`. Its datagrams have

    sender, number   as above
    age_s            age of the scan at the time of sending, s
    heights          m above the base's origin, in the order of the policy's grid; null for unknown ones
"""

import hmac
import json
import math
import secrets
import socket
import time
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

PORT, SCAN_PORT = 9870, 9871
TOKEN = "FOOTFALL_TOKEN"  # environment variable with footfall's token
MAX_DATAGRAM_BYTES = 16384  # maximum size of a datagram, bytes
MAC_BYTES = 32  # bytes
REQUEST, REPLY = b"footfall request ", b"footfall reply "  # so a reply cannot be sent back as a request
SCAN = b"footfall height scan "


def pack(content: dict[str, Any], token: str, direction: bytes) -> bytes:
    """Encode a datagram."""
    body = json.dumps(content).encode()
    return hmac.digest(token.encode(), direction + body, "sha256") + body


def unpack(datagram: bytes, token: str, direction: bytes) -> dict[str, Any] | None:
    """The content of a datagram; None if it is malformed or without the right token."""
    mac, body = datagram[:MAC_BYTES], datagram[MAC_BYTES:]
    if len(datagram) > MAX_DATAGRAM_BYTES or not hmac.compare_digest(
        mac, hmac.digest(token.encode(), direction + body, "sha256")
    ):
        return None
    try:
        content = json.loads(body)
    except (ValueError, RecursionError):
        return None
    return content if isinstance(content, dict) else None


class UdpSteering:
    """Controls a robot from a program."""

    def __init__(self, host: str, token: str, port: int = PORT, name: str = "udp") -> None:
        """`name`: name of the operator, shown in the robot's notes."""
        self._address, self._token, self._name = (host, port), token, name
        self._sender, self._number, self._challenge = secrets.token_hex(8), 0, ""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def __enter__(self) -> "UdpSteering":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send(self, wait_s: float = 0.1, **request: Any) -> dict[str, Any] | None:
        """Send a request and wait for its reply, a status of the run; None if none came in time.

        The reply's `refused` is the reason for a refusal; it is empty if the request was accepted.

        Raises:
            OSError: the network is unreachable.
        """
        reply = self._exchange(request, wait_s)
        if reply is not None and reply.get("refused") == "challenge":  # first request, or after a pause
            reply = self._exchange(request, wait_s)
        return reply

    def stop(self, reason: str, damp: bool = False) -> bool:
        """Stop the robot; sent up to five times. Returns whether the robot replied."""
        return any(self.send(stop=reason, damp=damp) is not None for _ in range(5))

    def _exchange(self, request: dict[str, Any], wait_s: float) -> dict[str, Any] | None:
        self._number += 1
        head = {
            "sender": self._sender,
            "number": self._number,
            "challenge": self._challenge,
            "name": self._name,
        }
        self._socket.sendto(pack(head | request, self._token, REQUEST), self._address)
        deadline_s = time.monotonic() + wait_s
        while (remaining_s := deadline_s - time.monotonic()) > 0.0:
            self._socket.settimeout(remaining_s)
            with suppress(TimeoutError, ConnectionRefusedError):
                reply = unpack(self._socket.recv(MAX_DATAGRAM_BYTES + 1), self._token, REPLY)
                if reply is not None and reply.get("sender") == self._sender:
                    self._challenge = reply.get("challenge", "")
                    if reply.get("number") == self._number:
                        return reply
        return None


class UdpHeightScan:
    """Sends height scans to a robot's policy."""

    def __init__(self, host: str, token: str, port: int = SCAN_PORT) -> None:
        self._address, self._token = (host, port), token
        self._sender, self._number = secrets.token_hex(8), 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)

    def __enter__(self) -> "UdpHeightScan":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send(self, heights: Iterable[float], age_s: float = 0.0) -> None:
        """Send a scan's heights, NaN for unknown ones, taken `age_s` ago.

        Raises:
            OSError: the network cannot be reached.
        """
        self._number += 1
        values = [round(float(each), 4) if math.isfinite(each) else None for each in heights]
        content = {"sender": self._sender, "number": self._number, "age_s": age_s, "heights": values}
        self._socket.sendto(pack(content, self._token, SCAN), self._address)
