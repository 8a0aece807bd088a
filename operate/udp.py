"""Control by a program on another computer through UDP datagrams (sent with `udp_client.py`).

A datagram is an HMAC-SHA256 with a shared token as its key, followed by JSON. A sender includes the latest
challenge that it has received, which is valid for at most three seconds, and numbers its datagrams. So
recorded datagrams that are sent again are refused, whether they are from this run or an earlier one.
"""

import math
import os
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from footfall.common.errors import UserError
from footfall.operate.abilities import Abilities
from footfall.operate.datagrams import answered_datagrams
from footfall.operate.inbox import Inbox
from footfall.operate.open_source import OpenSource
from footfall.operate.request_fields import MAX_NAME_CHARS, request_fields
from footfall.operate.udp_client import MAX_DATAGRAM_BYTES, PORT, REPLY, REQUEST, TOKEN, pack, unpack

MIN_TOKEN_CHARS = 16  # characters
CHALLENGE_S = 1.0  # a challenge is valid during this time and the next one
MAX_SENDERS = 64


@dataclass(frozen=True)
class UdpConfig:
    """Address to listen on."""

    address: str = f"127.0.0.1:{PORT}"  # only this computer; 0.0.0.0:9870 for all networks

    def __post_init__(self) -> None:
        host, colon, port = self.address.rpartition(":")
        if not (host and colon and port.isdecimal() and int(port) < 2**16):
            raise ValueError(f"address is HOST:PORT, such as 127.0.0.1:{PORT}, not '{self.address}'")

    @property
    def socket_address(self) -> tuple[str, int]:
        """Host and port."""
        host, _, port = self.address.rpartition(":")
        return host, int(port)


class Receiver:
    """Checks datagrams, and sends their requests to the inbox."""

    def __init__(self, inbox: Inbox, token: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._inbox, self._token, self._clock = inbox, token, clock
        self._challenges = [secrets.token_hex(8)] * 2  # the current and the previous one
        self._since_s = clock()
        self._latest: dict[str, tuple[int, float]] = {}  # by sender: latest number, and its time
        self.num_refused = 0  # datagrams without the right token
        self.answer = ""  # reply to the latest request

    def receive(self, datagram: bytes) -> bytes:
        """The reply to a datagram; empty for one without the right token."""
        request = unpack(datagram, self._token, REQUEST)
        if request is None:
            self.num_refused += 1
            return b""
        now_s = self._clock()
        self._renew(now_s)
        self.answer = self._stale_reason(request, now_s) or self._carry_out(request)
        return pack(self._reply(request), self._token, REPLY)

    def _renew(self, now_s: float) -> None:
        passed_s = now_s - self._since_s
        if passed_s < CHALLENGE_S:
            return
        new = secrets.token_hex(8)
        self._challenges = [new, self._challenges[0] if passed_s < 2 * CHALLENGE_S else new]
        self._since_s = now_s
        self._latest = {k: v for k, v in self._latest.items() if now_s - v[1] <= 3 * CHALLENGE_S}

    def _stale_reason(self, request: dict[str, Any], now_s: float) -> str:
        """Why a request is refused as an old one; empty if it is new."""
        sender, number = request.get("sender"), request.get("number")
        if not isinstance(sender, str) or not isinstance(number, int) or len(sender) > MAX_NAME_CHARS:
            return "sender and number are missing"
        if request.get("challenge") not in self._challenges:
            return "challenge"
        if number <= self._latest.get(sender, (-1, 0.0))[0]:
            return "an old datagram"
        if sender not in self._latest and len(self._latest) >= MAX_SENDERS:
            return "too many senders"
        self._latest[sender] = number, now_s
        return ""

    def _carry_out(self, request: dict[str, Any]) -> str:
        """Send a request to the inbox; returns why it is refused, or an empty string."""
        name = request.get("name", "udp")
        if "stop" in request:
            self._inbox.stop(name, request["stop"], damp=request.get("damp") is True)
            return ""
        if request.get("take_over") is True and (refusal := self._inbox.take_over(name)):
            return refusal
        fields = request_fields(request)
        return self._inbox.put(name, **fields) if fields else ""

    def _reply(self, request: dict[str, Any]) -> dict[str, Any]:
        reply: dict[str, Any] = {
            "sender": request.get("sender"),
            "number": request.get("number"),
            "challenge": self._challenges[0],
            "refused": self.answer,
            "owner": self._inbox.owner,
        }
        if (status := self._inbox.status) is not None:
            pose = None if math.isnan(status.pose.x_m) else list(status.pose)
            reply |= {
                "mode": status.mode.value,
                "policy": status.policy,
                "walking_s": status.walking_s,
                "pose": pose,
                "command": status.command.tolist(),
                "notes": [note[:200] for note in list(status.notes)[-2:]],
            }
        return reply


@contextmanager
def steered_by_udp(
    inbox: Inbox, abilities: Callable[[str], Abilities], config: UdpConfig
) -> Iterator[OpenSource]:
    """Control by datagrams through the inbox, while the context is open.

    Raises:
        UserError: the address cannot be used, or the token is too short to be a secret.
    """
    token = os.environ.get(TOKEN) or secrets.token_urlsafe(MIN_TOKEN_CHARS)
    if len(token) < MIN_TOKEN_CHARS:
        raise UserError(f"{TOKEN} is shorter than {MIN_TOKEN_CHARS} characters: choose a longer one")
    receiver, host = Receiver(inbox, token), config.socket_address[0]
    with answered_datagrams(
        config.socket_address, MAX_DATAGRAM_BYTES, receiver.receive, "--from udp"
    ) as port:
        secret = "" if TOKEN in os.environ else f", {TOKEN}={token}"
        about = f"datagrams to {host}:{port}{secret}"
        yield OpenSource(inbox, lambda: _line(receiver, inbox), (about,), odometry=True)


def _line(receiver: Receiver, inbox: Inbox) -> str:
    rejected = f"{receiver.num_refused} without the token" if receiver.num_refused else ""
    return ", ".join(filter(None, [f"udp: {inbox.owner or 'nobody'} has control", receiver.answer, rejected]))
