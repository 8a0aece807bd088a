"""A bridge steers over a Unix socket: requests reach the inbox, refusals are returned as a line."""

import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from walking_run import WALKING, abilities, eventually

from footfall.deploy.command_source import Behaviour
from footfall.operate.inbox import Inbox, InboxConfig
from footfall.operate.ros2.link import Link
from footfall.operate.ros2.path_source import PathSource
from footfall.operate.ros2.steering_socket import SteeringSocket


@pytest.fixture
def inbox() -> Inbox:
    """An inbox that tolerates long pauses of its owner, as a busy machine makes them."""
    inbox = Inbox(InboxConfig(still_after_s=60.0, lie_down_after_s=90.0))
    inbox.poll(WALKING)
    return inbox


@pytest.fixture
def paths(inbox: Inbox) -> PathSource:
    return PathSource(inbox, "ros2", abilities)


@pytest.fixture
def path(inbox: Inbox, paths: PathSource, tmp_path: Path) -> Iterator[Path]:
    server = SteeringSocket(tmp_path / "steer", inbox, paths, "ros2")
    yield tmp_path / "steer"
    server.close()


def test_requests_reach_the_inbox_and_refusals_are_returned(inbox: Inbox, path: Path) -> None:
    result: list[str] = []
    link = Link(str(path), lambda _: None, result.append)
    assert link.ask(velocity=[0.3, 0.0, 0.1], gait="wave", settings={"step_height_m": 0.04}) == ""
    request = inbox.poll(WALKING)
    assert (inbox.owner, request.velocity.tolist()) == ("ros2", [0.3, 0.0, 0.1])
    assert (request.gait, request.settings) == ("wave", {"step_height_m": 0.04})
    not_finite = {"velocity": [float("nan"), 0, 0]}
    for wrong in (not_finite, {"gait": "fly"}, {"weight": 1}, {"behaviour": ["walk"]}):
        assert "\n" not in link.ask(**wrong) != ""
    link.post(gait="fly")
    link.post(gait="fly")
    link.post(wish="stand")  # former name
    assert eventually(lambda: inbox.poll(WALKING).behaviour is Behaviour.STAND)
    assert len(result) == 1, "the same refusal is reported once"
    assert inbox.take_over("page") == ""
    assert link.ask(velocity=[0.1, 0, 0]) != ""
    assert link.ask(take_over=True) == link.ask(velocity=[0.1, 0, 0]) == ""
    assert inbox.stopped is None
    assert link.ask(stop="a service") == ""
    assert "ros2" in inbox.stopped.reason


def test_the_bridge_receives_the_status_and_each_note_once(inbox: Inbox, path: Path) -> None:
    received: list[dict[str, Any]] = []
    Link(str(path), received.append, lambda _: None)
    assert eventually(lambda: received)
    inbox.poll(WALKING._replace(notes=("a", "b"), policy="stand"))
    assert eventually(lambda: received[-1]["policy"] == "stand")
    assert [note for status in received for note in status["notes"]] == ["a", "b"]
    assert received[-1]["settings"]["step_height_m"] == [0.02, 0.1, 0.05]
    assert (received[-1]["gaits"], received[-1]["pose"]) == (["trot", "wave"], [1, 2, 0])


def test_a_run_waits_for_the_first_request_and_ends_after_silence(tmp_path: Path) -> None:
    inbox = Inbox(InboxConfig(still_after_s=0.2, lie_down_after_s=0.3))
    inbox.poll(WALKING)
    server = SteeringSocket(tmp_path / "steer", inbox, PathSource(inbox, "ros2", abilities), "ros2")
    link = Link(str(tmp_path / "steer"), lambda _: None, lambda _: None)
    end_s = time.monotonic() + 0.8
    while time.monotonic() < end_s:
        assert inbox.poll(WALKING).behaviour is Behaviour.WALK
        time.sleep(0.01)
    assert link.ask(velocity=[0.1, 0, 0]) == ""
    assert eventually(lambda: inbox.poll(WALKING).behaviour is Behaviour.LIE_DOWN)
    server.close()


def test_a_lost_bridge_stops_steering_for_another(inbox: Inbox, paths: PathSource, path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as raw:
        raw.connect(str(path))
        raw.sendall(b'{"velocity": [0.2, 0, 0]}\n')
        assert eventually(lambda: inbox.poll(WALKING).velocity[0] == 0.2)
        raw.sendall(b'{"path": [[5, 2]], "goal": 1}\n')
        assert eventually(lambda: paths.state), "a walk along a path, which needs no more messages"
        assert paths.poll(WALKING).velocity[0] > 0.0
    assert eventually(lambda: paths.poll(WALKING).velocity[0] == 0.0), "before its silence counts"
    assert inbox.owner == ""
    assert "gone" in eventually(lambda: inbox.poll(WALKING).note)
    link = Link(str(path), lambda _: None, lambda _: None)
    assert link.ask(velocity=[0.1, 0, 0]) == ""
