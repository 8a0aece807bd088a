"""Datagrams steer a run if they hold the token, the latest challenge and a new number."""

import socket

import pytest
from fake_time import Watch
from walking_run import WALKING, abilities, polled_until

from footfall.common.errors import UserError
from footfall.deploy.command_source import Behaviour
from footfall.operate.inbox import Inbox
from footfall.operate.udp import Receiver, UdpConfig, steered_by_udp
from footfall.operate.udp_client import REPLY, REQUEST, UdpSteering, pack, unpack

TOKEN = "a token of the tests, shared"


class Sender:
    """A holder of a token, without a network."""

    def __init__(self, receiver: Receiver) -> None:
        self._receiver = receiver
        self.head = {"sender": "s", "number": 0, "challenge": "", "name": "planner"}
        self.sent = b""

    def send(self, **request: object) -> str:
        """The refusal; 'no reply' without one."""
        self.head["number"] = int(self.head["number"]) + 1
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
        b"",
        b"x" * 40,
        b"x" * 9000,
        pack({"sender": "s", "number": 99, "velocity": [1, 0, 0]}, "another token, as long", REQUEST),
        pack({**sender.head, "number": 99, "velocity": [1, 0, 0]}, TOKEN, REPLY),  # of the other direction
        first[:-1] + b" ",
    ):
        assert receiver.receive(foreign) == b""
    assert "old" in sender.again(first)
    assert "not finite" in sender.send(velocity=[float("nan"), 0, 0])
    assert sender.send(velocity="fast")
    for odd in ({"sender": 3}, {"number": "7"}, {"number": None}, {"challenge": []}, {"name": 5}):
        assert receiver.receive(
            pack(sender.head | {"number": 500, "velocity": [1, 0, 0]} | odd, TOKEN, REQUEST)
        )
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
    assert inbox.stopped is not None
    assert "planner" in inbox.stopped.reason
    other_inbox = Inbox()
    damping = Sender(Receiver(other_inbox, TOKEN, watch))
    damping.send(stop="now", damp=True)
    assert damping.send(stop="now", damp=True) == ""  # with the received challenge
    assert other_inbox.stopped is not None
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
            assert reply is not None
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
