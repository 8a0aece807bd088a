"""The cockpit's server: access, accepted commands, and the effect of silence."""

import json
import time
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from ports import free_port
from walking_run import WALKING, eventually

from footfall import Robot, UserError
from footfall.deploy.modes import Mode
from footfall.operate.inbox import Inbox
from footfall.pages.cockpit.freshness import MAX_ANSWER_S, Freshness

pytest.importorskip("websockets")

from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from footfall.pages.cockpit.beside import cockpit

PATIENCE_S = 20.0
STANDING = WALKING._replace(mode=Mode.STANDING)


@pytest.fixture(scope="module")
def served(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    """A cockpit whose run has no feed, with the inbox that takes its commands."""
    port, inbox = free_port(), Inbox()
    with cockpit(inbox, "localhost", port, go1, tmp_path_factory.mktemp("none") / "feed") as (link, address):
        token = parse_qs(urlsplit(address).query)["token"][0]
        yield SimpleNamespace(
            inbox=inbox, link=link, port=port, token=token, origin=f"http://localhost:{port}"
        )


class Visitor:
    """A program that sends the same messages as the page."""

    def __init__(self, served: SimpleNamespace, token: str | None = None, origin: str | None = None) -> None:
        address = f"ws://localhost:{served.port}/steer?token={served.token if token is None else token}"
        self.socket: ClientConnection = connect(address, origin=origin or served.origin)  # type: ignore[arg-type]
        self.number = 0
        self.hear()

    def hear(self) -> dict[str, Any]:
        """The next state."""
        while "challenge" not in (message := json.loads(self.socket.recv(PATIENCE_S))):
            pass
        self.challenge, self.name = message["challenge"], message["you"]
        return message

    def ask(self, **message: Any) -> None:
        self.number += 1
        self.socket.send(json.dumps({"number": self.number, "answer": self.challenge} | message))

    def refusal(self) -> str:
        """Reason for the refusal of the last message."""
        while "refused" not in (message := json.loads(self.socket.recv(PATIENCE_S))):
            pass
        return str(message["refused"])

    def take_control(self, inbox: Inbox) -> None:
        self.hear()
        self.ask(do="take")
        assert eventually(lambda: inbox.owner == self.name, PATIENCE_S)


@pytest.fixture
def visitor(served: SimpleNamespace) -> Iterator[Visitor]:
    visitor = Visitor(served)
    with visitor.socket:
        yield visitor


def page_status(served: SimpleNamespace, path: str, **headers: str) -> tuple[int, dict[str, str]]:
    connection = HTTPConnection("localhost", served.port, timeout=PATIENCE_S)
    connection.request("GET", path, headers={"Host": f"localhost:{served.port}"} | headers)
    answer = connection.getresponse()
    answer.read()
    return answer.status, dict(answer.getheaders())


class TestAccess:
    def test_only_the_printed_address_opens_the_page_once(self, served: SimpleNamespace) -> None:
        status, headers = page_status(served, f"/?token={served.token}")
        assert status == 200
        assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
        assert {"HttpOnly", "SameSite=Strict"} <= set(headers["Set-Cookie"].split("; "))
        kept = headers["Set-Cookie"].split(";")[0]
        assert page_status(served, "/", Cookie=kept)[0] == 200
        for path in ("/", "/?token=", "/?token=%C3%A4", f"/?token={served.token}x"):
            assert page_status(served, path)[0] == 403
        assert page_status(served, "/", Cookie=f"{kept}x")[0] == 403
        assert page_status(served, f"/?token={served.token}", Host="evil.example")[0] == 403

    @pytest.mark.parametrize(
        "wrong",
        [
            {"token": ""},
            {"token": "guess"},
            {"origin": "http://evil.example"},
            {"origin": "http://localhost:1"},
        ],
    )
    def test_other_pages_and_tokens_are_refused(self, served: SimpleNamespace, wrong: dict[str, str]) -> None:
        with pytest.raises(InvalidStatus) as caught:
            Visitor(served, **wrong)
        assert caught.value.response.status_code == 403

    def test_a_connection_without_an_origin_is_refused(self, served: SimpleNamespace) -> None:
        with pytest.raises(InvalidStatus):
            connect(f"ws://localhost:{served.port}/steer?token={served.token}")


class TestCommands:
    def test_the_owner_of_control_moves_the_robot(self, served: SimpleNamespace, visitor: Visitor) -> None:
        visitor.ask(do="put", velocity=[0.3, 0.0, 0.1])
        assert "take control" in visitor.refusal()
        visitor.take_control(served.inbox)
        visitor.ask(do="put", velocity=[0.3, 0.0, 0.1])
        assert eventually(lambda: requested_velocity(served.inbox).tolist() == [0.3, 0.0, 0.1], PATIENCE_S)
        other = Visitor(served)
        other.ask(do="put", velocity=[-0.5, 0.0, 0.0])
        assert "take control" in other.refusal()
        other.take_control(served.inbox)
        other.ask(do="put", velocity=[-0.5, 0.0, 0.0])
        assert eventually(lambda: requested_velocity(served.inbox).tolist() == [-0.5, 0.0, 0.0], PATIENCE_S)
        other.socket.close()  # at once, before the server has the owner of control
        assert eventually(lambda: not requested_velocity(served.inbox).any(), PATIENCE_S)

    def test_old_or_wrong_requests_change_nothing(self, served: SimpleNamespace, visitor: Visitor) -> None:
        visitor.take_control(served.inbox)
        visitor.ask(do="put", velocity=[0.2, 0.0, 0.0])
        assert eventually(lambda: requested_velocity(served.inbox)[0] == 0.2, PATIENCE_S)
        for message in (
            {"number": 1, "answer": visitor.challenge},
            {"number": 99, "answer": visitor.challenge + 1},
            {"number": 99, "answer": str(visitor.challenge)},
            {"number": None},
            {"do": "reset"},
            {"do": ["put"]},
            {"velocity": [1.0]},
            {"velocity": "fast"},
            {"velocity": [0.1, float("nan"), 0.0]},
            {"gait": {"a": 1}},
            {"settings": [1]},
        ):
            visitor.hear()
            visitor.ask(**({"do": "put", "velocity": [0.9, 0.0, 0.0]} | message))
            assert visitor.refusal()
        for content in ("", "[]", "null", "{", '"put"', b"\xff"):
            visitor.socket.send(content)
            if isinstance(content, str):
                assert visitor.refusal()
        assert requested_velocity(served.inbox).tolist() == [0.2, 0.0, 0.0]

    def test_a_stop_of_any_page_and_age_counts_and_is_repeated(self, go1: Robot, tmp_path: Path) -> None:
        port, inbox = free_port(), Inbox()
        with cockpit(inbox, "localhost", port, go1, tmp_path / "feed") as (_, address):
            token = parse_qs(urlsplit(address).query)["token"][0]
            here = SimpleNamespace(port=port, token=token, origin=f"http://localhost:{port}")
            with Visitor(here).socket as stopping:
                for _ in range(5):
                    stopping.send('{"do": "stop"}')
                assert eventually(lambda: inbox.stopped is not None, PATIENCE_S)
                time.sleep(0.1)
                assert inbox.stopped is not None
                assert not inbox.stopped.damp
                stopping.send('{"do": "stop", "damp": true}')
                assert eventually(lambda: inbox.stopped is not None and inbox.stopped.damp, PATIENCE_S)
            taken = cockpit(inbox, "localhost", port, go1, tmp_path)
            with pytest.raises(UserError), taken:
                pytest.fail("the port is taken")


def requested_velocity(inbox: Inbox) -> np.ndarray:
    """The owner's last requested velocity, of any age."""
    return inbox.poll(STANDING).velocity


def test_a_command_with_a_long_transport_time_is_refused() -> None:
    now = SimpleNamespace(s=10.0)
    fresh = Freshness(lambda: now.s)
    challenge = fresh.challenge()
    now.s += 0.9 * MAX_ANSWER_S
    assert fresh.refusal(1, challenge) == ""
    assert "old" in fresh.refusal(1, challenge)  # arrives twice
    now.s += 0.2 * MAX_ANSWER_S
    assert "old" in fresh.refusal(2, challenge)  # delayed for too long
    assert fresh.refusal(2, fresh.challenge()) == ""
    assert fresh.round_trip_s == 0.0
