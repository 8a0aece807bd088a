"""The cockpit in a browser: a held key moves the robot, and several events end a motion."""

import multiprocessing
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from browser import Tab, chromium, tab
from ports import free_port
from walking_run import WALKING, eventually

from footfall.operate.inbox import Inbox, InboxConfig
from footfall.robots.description import Robot

pytest.importorskip("websockets")

from footfall.pages.cockpit.beside import cockpit

pytestmark = pytest.mark.skipif(chromium() is None, reason="needs Chromium")

PATIENCE_S = 60.0  # for rendering in software on a busy machine
W = {"code": "KeyW", "key": "w"}


@pytest.fixture
def opened(go1: Robot, tmp_path: Path) -> Iterator[SimpleNamespace]:
    """The cockpit of a run that walks, in a browser that has control."""
    port = free_port()
    inbox = Inbox(InboxConfig(lie_down_after_s=600.0))
    inbox.poll(WALKING)
    with (
        cockpit(inbox, "localhost", port, go1, tmp_path / "feed") as (_, address),
        tab(tmp_path / "profile", 400, 800) as page,
    ):
        page.go(address)
        page.wait_for(lambda page: bool(page.value("!document.getElementById('take').disabled")))
        page.wait_for(lambda page: bool(inbox.owner or page.value("document.getElementById('take').click()")))
        (server,) = [each for each in multiprocessing.active_children() if each.name == "cockpit"]
        yield SimpleNamespace(page=page, inbox=inbox, server=server.pid)


def test_a_motion_lasts_as_long_as_its_key_is_held(opened: SimpleNamespace) -> None:
    page: Tab = opened.page
    inbox: Inbox = opened.inbox

    def moves() -> bool:
        return bool(inbox.poll(WALKING).velocity[0] > 0.0)

    def hold() -> None:
        page.ask("Input.dispatchKeyEvent", type="keyDown", **W)
        assert eventually(moves, PATIENCE_S)

    def stands() -> bool:
        return bool(eventually(lambda: not inbox.poll(WALKING).velocity.any(), PATIENCE_S))

    assert "token" not in page.value("location.href")
    hold()
    page.ask("Input.dispatchKeyEvent", type="keyUp", **W)
    assert stands()
    hold()
    page.value("dispatchEvent(new Event('blur'))")
    assert stands()
    hold()
    page.value("Object.defineProperty(document, 'hidden', {configurable: true, get: () => true})")
    page.value("document.dispatchEvent(new Event('visibilitychange'))")
    assert stands()
    page.value("delete document.hidden")
    assert not eventually(moves, 0.5)  # no key was pressed meanwhile
    hold()

    os.kill(opened.server, signal.SIGSTOP)  # the network stalls
    assert stands()
    page.wait_for(lambda page: "No connection" in page.text)
    page.value("document.getElementById('stop').dispatchEvent(new PointerEvent('pointerdown'))")
    os.kill(opened.server, signal.SIGCONT)  # the delayed messages arrive
    assert eventually(lambda: inbox.stopped, PATIENCE_S)
    page.wait_for(lambda page: "Stopped" in page.text)
    assert stands()
    assert page.value("document.documentElement.scrollWidth <= innerWidth")
    assert page.errors == []
    assert all(address.split("/")[2].startswith("localhost") for address in page.requested if "//" in address)
