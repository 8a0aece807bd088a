"""The cockpit: access, accepted commands, the effect of silence, and its keys in a browser."""

import json
import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from urllib.parse import parse_qs, urlsplit

import pytest
from browser import chromium, tab
from ports import free_port
from walking_run import WALKING, eventually

from footfall import Robot, UserError
from footfall.deploy.modes import Mode
from footfall.operate.inbox import Inbox, InboxConfig
from footfall.pages.cockpit.freshness import MAX_ANSWER_S, Freshness

pytest.importorskip("websockets")

from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect

from footfall.pages.cockpit.beside import cockpit

PATIENCE_S = 60.0  # for rendering in software on a busy machine
STANDING = WALKING._replace(mode=Mode.STANDING)


@contextmanager
def serving(robot: Robot, feed: Path, inbox: Inbox | None = None) -> Iterator[SimpleNamespace]:
    """A cockpit whose run has no feed, with the inbox that takes its commands."""
    port, inbox = free_port(), inbox or Inbox()
    with cockpit(inbox, "localhost", port, robot, feed) as (_, address):
        token = parse_qs(urlsplit(address).query)["token"][0]
        yield SimpleNamespace(inbox=inbox, port=port, token=token, address=address)


@pytest.fixture(scope="module")
def served(go1: Robot, tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimpleNamespace]:
    with serving(go1, tmp_path_factory.mktemp("none") / "feed") as served:
        yield served


def steering(served: SimpleNamespace, **changes: str) -> ClientConnection:
    """A connection to the cockpit, with its own token and origin unless others are given."""
    given: dict[str, Any] = {"token": served.token, "origin": f"http://localhost:{served.port}"} | changes
    return connect(f"ws://localhost:{served.port}/steer?token={given['token']}", origin=given["origin"])


class Visitor:
    """A program that sends the same messages as the page."""

    def __init__(self, served: SimpleNamespace) -> None:
        self.socket = steering(served)
        self.number = 0
        self.receive_state()

    def message_with(self, key: str) -> dict[str, Any]:
        """The next message that has this key."""
        while key not in (message := json.loads(self.socket.recv(PATIENCE_S))):
            pass
        return dict(message)

    def receive_state(self) -> None:
        state = self.message_with("challenge")
        self.challenge, self.name = state["challenge"], state["you"]

    def send(self, **message: Any) -> None:
        self.number += 1
        self.socket.send(json.dumps({"number": self.number, "answer": self.challenge} | message))

    def refusal(self) -> str:
        """Reason for the refusal of the last message."""
        return str(self.message_with("refused")["refused"])

    def take_control(self, inbox: Inbox) -> None:
        self.receive_state()
        self.send(do="take")
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
        cookie = headers["Set-Cookie"].split(";")[0]
        assert page_status(served, "/", Cookie=cookie)[0] == 200
        for path in ("/", "/?token=", "/?token=%C3%A4", f"/?token={served.token}x"):
            assert page_status(served, path)[0] == 403
        assert page_status(served, "/", Cookie=f"{cookie}x")[0] == 403
        assert page_status(served, f"/?token={served.token}", Host="evil.example")[0] == 403

    def test_other_pages_and_tokens_are_refused(self, served: SimpleNamespace) -> None:
        refused = [{"token": token} for token in ("", "guess")]
        refused += [{"origin": origin} for origin in ("http://evil.example", "http://localhost:1", None)]
        for changes in refused:
            with pytest.raises(InvalidStatus) as caught:
                steering(served, **changes)
            assert caught.value.response.status_code == 403


def velocity_becomes(inbox: Inbox, velocity: list[float]) -> bool:
    """Whether the velocity command becomes this one; while STANDING, it does not expire."""
    return bool(eventually(lambda: inbox.poll(STANDING).velocity.tolist() == velocity, PATIENCE_S))


class TestCommands:
    def test_the_owner_of_control_moves_the_robot(self, served: SimpleNamespace, visitor: Visitor) -> None:
        def take_and_move(visitor: Visitor, velocity: list[float]) -> None:
            visitor.send(do="put", velocity=velocity)
            assert "take control" in visitor.refusal()
            visitor.take_control(served.inbox)
            visitor.send(do="put", velocity=velocity)
            assert velocity_becomes(served.inbox, velocity)

        take_and_move(visitor, [0.3, 0.0, 0.1])
        other = Visitor(served)
        take_and_move(other, [-0.5, 0.0, 0.0])
        other.socket.close()  # before the server's next state names it as the owner
        assert velocity_becomes(served.inbox, [0.0, 0.0, 0.0])

    def test_old_or_wrong_requests_change_nothing(self, served: SimpleNamespace, visitor: Visitor) -> None:
        visitor.take_control(served.inbox)
        visitor.send(do="put", velocity=[0.2, 0.0, 0.0])
        assert velocity_becomes(served.inbox, [0.2, 0.0, 0.0])
        for message in (
            {"number": 1, "answer": visitor.challenge},
            {"number": 99, "answer": visitor.challenge + 1},
            {"number": 99, "answer": str(visitor.challenge)}, {"number": None},
            {"do": "reset"}, {"do": ["put"]},
            {"velocity": [1.0]}, {"velocity": "fast"}, {"velocity": [0.1, float("nan"), 0.0]},
            {"gait": {"a": 1}}, {"settings": [1]},
        ):  # fmt: skip
            visitor.receive_state()
            visitor.send(**({"do": "put", "velocity": [0.9, 0.0, 0.0]} | message))
            assert visitor.refusal()
        for content in ("", "[]", "null", "{", '"put"', b"\xff"):
            visitor.socket.send(content)
            if isinstance(content, str):
                assert visitor.refusal()
        assert served.inbox.poll(STANDING).velocity.tolist() == [0.2, 0.0, 0.0]

    def test_any_page_may_stop_the_robot_and_then_damp_it(self, go1: Robot, tmp_path: Path) -> None:
        with serving(go1, tmp_path / "feed") as served:
            inbox = served.inbox
            with steering(served) as stopping:
                for _ in range(5):
                    stopping.send('{"do": "stop"}')
                assert eventually(lambda: inbox.stopped, PATIENCE_S)
                time.sleep(0.1)
                assert not inbox.stopped.damp
                stopping.send('{"do": "stop", "damp": true}')
                assert eventually(lambda: inbox.stopped.damp, PATIENCE_S)
            with pytest.raises(UserError), cockpit(inbox, "localhost", served.port, go1, tmp_path):
                pytest.fail("the port is taken")


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


@pytest.mark.skipif(chromium() is None, reason="needs Chromium")
def test_a_motion_lasts_as_long_as_its_key_is_held(go1: Robot, tmp_path: Path) -> None:
    inbox, key = Inbox(InboxConfig(lie_down_after_s=600.0)), {"code": "KeyW", "key": "w"}
    inbox.poll(WALKING)

    def moves() -> bool:
        return bool(inbox.poll(WALKING).velocity[0] > 0.0)

    def hold() -> None:
        page.ask("Input.dispatchKeyEvent", type="keyDown", **key)
        assert eventually(moves, PATIENCE_S)

    def stops() -> bool:
        return bool(eventually(lambda: not inbox.poll(WALKING).velocity.any(), PATIENCE_S))

    others = multiprocessing.active_children()
    with serving(go1, tmp_path / "feed", inbox) as served, tab(tmp_path / "profile", 400, 800) as page:
        (server,) = set(multiprocessing.active_children()) - set(others)
        page.go(served.address)
        page.wait_for(lambda page: bool(page.value("!document.getElementById('take').disabled")))
        page.wait_for(lambda page: bool(inbox.owner or page.value("document.getElementById('take').click()")))
        assert "token" not in page.value("location.href")
        hold()
        page.ask("Input.dispatchKeyEvent", type="keyUp", **key)
        assert stops()
        hold()
        page.value("dispatchEvent(new Event('blur'))")
        assert stops()
        hold()
        page.value("Object.defineProperty(document, 'hidden', {configurable: true, get: () => true})")
        page.value("document.dispatchEvent(new Event('visibilitychange'))")
        assert stops()
        page.value("delete document.hidden")
        assert not eventually(moves, 0.5)  # no key was pressed meanwhile
        hold()

        os.kill(server.pid, signal.SIGSTOP)  # the network stalls
        assert stops()
        page.wait_for(lambda page: "No connection" in page.text)
        page.value("document.getElementById('stop').dispatchEvent(new PointerEvent('pointerdown'))")
        os.kill(server.pid, signal.SIGCONT)  # the delayed messages arrive
        assert eventually(lambda: inbox.stopped, PATIENCE_S)
        page.wait_for(lambda page: "Stopped" in page.text)
        assert stops()
        assert page.value("document.documentElement.scrollWidth <= innerWidth")
        assert page.errors == []
        assert all(each.split("/")[2].startswith("localhost") for each in page.requested if "//" in each)
