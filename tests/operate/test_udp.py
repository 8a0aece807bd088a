"""Datagrams steer a run, or bring height scans, if they hold the token and a new number."""

import math
import socket
from typing import Any

import numpy as np
import pytest
from fake_time import Watch
from ports import free_port
from walking_run import WALKING, abilities, eventually, polled_until

from footfall.common.errors import UserError
from footfall.deploy.command_source import Behaviour
from footfall.operate.height_scan_udp import UdpScans, scans_by_udp
from footfall.operate.inbox import Inbox
from footfall.operate.udp import MAX_SENDERS, Receiver, UdpConfig, steered_by_udp
from footfall.operate.udp_client import REPLY, REQUEST, SCAN, UdpHeightScan, UdpSteering, pack, unpack

TOKEN = "a token of the tests, shared"


class Sender:
    """A holder of a token, without a network."""

    def __init__(self, receiver: Receiver) -> None:
        self._receiver = receiver
        self.head: dict[str, Any] = {"sender": "s", "number": 0, "challenge": "", "name": "planner"}
        self.sent = b""

    def send(self, **request: object) -> str:
        """The refusal; 'no reply' without one."""
        self.head["number"] += 1
        self.sent = pack(self.head | request, TOKEN, REQUEST)
        return self.again(self.sent)

    def again(self, datagram: bytes) -> str:
        reply = unpack(self._receiver.receive(datagram), TOKEN, REPLY)
        if reply is None:
            return "no reply"
        self.head["challenge"] = reply["challenge"]
        return str(reply["refused"])


def test_only_fresh_datagrams_of_holders_of_the_token_steer() -> None:
    inbox, watch = Inbox(), Watch()
    inbox.poll(WALKING)
    receiver = Receiver(inbox, TOKEN, watch)
    sender = Sender(receiver)
    assert sender.send(velocity=[0.9, 0, 0]) == "challenge"
    assert not inbox.poll(WALKING).velocity.any()
    assert sender.send(velocity=[0.3, 0, 0]) == ""
    first = sender.sent
    assert sender.send(velocity=[0.2, 0, 0]) == ""
    for foreign in (
        *(b"", b"x" * 40, b"x" * 9000),
        pack({"sender": "s", "number": 99, "velocity": [1, 0, 0]}, "another token, as long", REQUEST),
        pack({**sender.head, "number": 99, "velocity": [1, 0, 0]}, TOKEN, REPLY),  # of the other direction
        first[:-1] + b" ",
    ):
        assert receiver.receive(foreign) == b""
    assert "old" in sender.again(first)
    assert "not finite" in sender.send(velocity=[float("nan"), 0, 0])
    assert sender.send(velocity="fast")
    for odd in ({"sender": 3}, {"number": "7"}, {"number": None}, {"challenge": []}, {"name": 5}):
        content = sender.head | {"number": 500, "velocity": [1, 0, 0]} | odd
        assert receiver.receive(pack(content, TOKEN, REQUEST))
    assert receiver.receive(pack([], TOKEN, REQUEST)) == b""  # type: ignore[arg-type]
    assert inbox.poll(WALKING).velocity.tolist() == [0.2, 0.0, 0.0]
    last = sender.sent
    watch.now_s += 5.0  # a datagram that was delayed
    assert sender.again(last) == "challenge"
    sender.head["number"] = 1000
    assert sender.send(velocity=[0.1, 0, 0]) == ""
    other = Sender(Receiver(Inbox(), TOKEN, watch))  # another run with the same token
    assert other.again(sender.sent) == "challenge"
    assert sender.send(wish="stand") == ""  # former name of `behaviour`
    assert inbox.poll(WALKING).behaviour is Behaviour.STAND
    assert sender.send(stop="a cable") == ""
    assert "planner" in inbox.stopped.reason
    other_inbox = Inbox()
    damping = Sender(Receiver(other_inbox, TOKEN, watch))
    damping.send(stop="now", damp=True)
    assert damping.send(stop="now", damp=True) == ""  # with the received challenge
    assert other_inbox.stopped.damp


def test_a_client_steers_over_the_network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FOOTFALL_TOKEN", TOKEN)
    inbox = Inbox()
    with steered_by_udp(inbox, abilities, UdpConfig("127.0.0.1:0")) as opened:
        port = int(opened.about[0].rpartition(":")[2])
        assert TOKEN not in opened.about[0]
        inbox.poll(WALKING)
        with UdpSteering("127.0.0.1", TOKEN, port, "planner") as steering:
            reply = steering.send(velocity=[0.3, 0, 0.1], gait="wave", wait_s=20.0)
            assert (reply["refused"], reply["owner"], reply["mode"]) == ("", "planner", "WALKING")
            assert polled_until(inbox, lambda r: r.velocity.any()).gait == "wave"
            assert steering.stop("enough")
            assert inbox.stopped is not None
        with UdpSteering("127.0.0.1", "another token, as long", port) as stranger:
            assert stranger.send(velocity=[1, 0, 0], wait_s=0.05) is None
        with pytest.raises(UserError), steered_by_udp(inbox, abilities, UdpConfig(f"127.0.0.1:{port}")):
            pass
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", port))


def test_short_tokens_and_wrong_addresses_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for address in ("", "9870", "localhost:", ":9870", "host:99999", "host:x"):
        with pytest.raises(ValueError, match="HOST:PORT"):
            UdpConfig(address)
    monkeypatch.setenv("FOOTFALL_TOKEN", "short")
    with pytest.raises(UserError), steered_by_udp(Inbox(), abilities, UdpConfig("127.0.0.1:0")):
        pass
    with pytest.raises(UserError, match="FOOTFALL_TOKEN"), scans_by_udp():
        pass
    monkeypatch.setenv("FOOTFALL_TOKEN", TOKEN)
    with pytest.raises(UserError, match=r"9871.*nowhere"), scans_by_udp("nowhere"):  # the scans' port
        pass


SCAN_CONTENT = {"sender": "s", "number": 7, "age_s": 0.1, "heights": [-0.3, None, 0.1]}


def test_a_scans_age_counts_from_its_measurement() -> None:
    watch = Watch()
    scans = UdpScans(TOKEN, watch)
    assert scans.newest(0) is None
    assert scans.receive(pack(SCAN_CONTENT, TOKEN, SCAN)) == ""
    watch.now_s += 0.25
    found = scans.newest(2_000_000)
    assert found.taken_us == pytest.approx(2_000_000 - 350_000, abs=1)
    np.testing.assert_array_equal(found.heights, [-0.3, math.nan, 0.1])


def test_a_wrong_or_old_scan_is_refused() -> None:
    for wrong in (
        *({"number": 6}, {"number": None}, {"sender": 3}),
        *({"age_s": age_s} for age_s in (-1.0, "old", math.nan)),
        *({"heights": heights} for heights in ("flat", [0.1, "x"], [True], [10**400])),
    ):
        scans = UdpScans(TOKEN, Watch())
        assert scans.receive(pack(SCAN_CONTENT, TOKEN, SCAN)) == ""
        assert scans.receive(pack(SCAN_CONTENT | {"number": 8, "heights": [9.0]} | wrong, TOKEN, SCAN)), wrong
        assert len(scans.newest(0).heights) == 3, wrong


def test_a_mapping_program_may_restart_any_number_of_times() -> None:
    """A second sender that keeps sending is remembered all the time: its old datagrams stay refused."""
    scans = UdpScans(TOKEN, Watch())
    steady = pack(SCAN_CONTENT | {"sender": "steady", "number": 0}, TOKEN, SCAN)
    assert scans.receive(steady) == ""
    for restart in range(2 * MAX_SENDERS):
        for changes in ({"sender": f"{restart}", "number": 1}, {"sender": "steady", "number": restart + 1}):
            assert scans.receive(pack(SCAN_CONTENT | changes, TOKEN, SCAN)) == ""
    assert scans.receive(steady) != ""
    assert len(scans._last_numbers) == MAX_SENDERS


def test_scans_arrive_over_a_network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FOOTFALL_TOKEN", TOKEN)
    port = free_port()
    with scans_by_udp(f"127.0.0.1:{port}") as scans, UdpHeightScan("127.0.0.1", TOKEN, port) as sender:

        def arrived() -> bool:
            sender.send([-0.31, math.nan], age_s=0.02)
            return scans.newest(0) is not None

        assert eventually(arrived)
    np.testing.assert_array_equal(scans.newest(0).heights, [-0.31, math.nan])
