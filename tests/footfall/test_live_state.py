"""Live display of `footfall deploy`, and its notifications to a service manager."""

import io
import socket
import threading
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold, short_episode
from rich.console import Console
from scipy.spatial.transform import Rotation

from footfall import Robot, run_episode
from footfall import live_state as module
from footfall.deploy.battery import BatteryState
from footfall.deploy.safety import State
from footfall.deploy.timing import Timing
from footfall.live_state import describe, live_state
from footfall.service_manager import notifying_service_manager


def displayed(robot: Robot, **console: Any) -> str:
    """The display of a walk of half a second, whose thread gets time."""
    out = io.StringIO()
    display = partial(live_state, duration_s=0.5, console=Console(file=out, width=200, **console))
    episode = short_episode(duration_s=0.5, display=display)
    run_episode(robot, Hold(robot), episode, lambda *_: time.sleep(0.001))
    return out.getvalue()


def test_every_part_of_a_state_is_shown() -> None:
    """All fields have different numbers; the robot is tilted by 0.3 rad and turned."""
    attitude = Rotation.from_euler("ZX", [1.1, 0.3]).as_quat()[[3, 0, 1, 2]]
    loop: Any = SimpleNamespace(
        walking=True, walking_s=1.26, walked_s=4.2,
        state=SimpleNamespace(mode=SimpleNamespace(value="WALKING")),
        requested_command=(0.5, -0.25, 0.75), sensed=SimpleNamespace(quaternion=attitude),
        timing=Timing(ticks_skipped=7), held_up=False, battery=BatteryState(charge=0.42),
    )  # fmt: skip
    for loop.walking, time_s in ((True, "1.3"), (False, "4.2")):
        text = describe(loop, np.array([0.11, -0.22, 9.0]), 2.5)
        numbers = (f"{time_s} of 2.5 s", "+0.50 -0.25", "+0.75", "+0.11 -0.22", "42%", "0.30 rad", "7 ticks")
        assert [number for number in (*numbers, "WALKING") if number not in text] == []
    for unknown in (np.full(3, np.nan), np.array([0.1, np.nan, 0.0])):
        assert "velocity" not in describe(loop, unknown, 0.1)


def test_without_a_terminal_plain_lines_appear(go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "LINE_INTERVAL_S", 0.1)
    lines = displayed(go1).splitlines()
    assert len(lines) >= 2
    assert "live state" not in {thread.name for thread in threading.enumerate()}
    assert all(" of 0.5 s, " in line and "\x1b" not in line for line in lines)


def test_on_a_terminal_the_state_is_updated_in_place_and_erased_at_the_end(go1: Robot) -> None:
    text = displayed(go1, force_terminal=True)
    assert "WALKING" in text
    assert text.rstrip("\n").endswith("\x1b[2K")  # the line has been erased


def test_heartbeats_need_a_loop_that_ticks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loop: Any = SimpleNamespace(state=State(), battery=BatteryState(charge=0.42), heartbeat_s=0.0)
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    with notifying_service_manager(loop):
        pass  # without a service manager nothing happens
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
    monkeypatch.setenv("WATCHDOG_USEC", "40000")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:  # in place of systemd's
        manager.bind(str(tmp_path / "notify"))
        for age_s, alive in ((0.0, True), (10.0, False)):
            manager.settimeout(5.0)
            loop.heartbeat_s = time.perf_counter() - age_s
            with notifying_service_manager(loop):
                first, second = manager.recv(1000), manager.recv(1000)
            assert first == b"READY=1\nSTATUS=IDLE, battery 42%"
            assert (b"WATCHDOG=1" in second) is alive
            manager.settimeout(0.0)
            last = b""
            with suppress(BlockingIOError):
                while True:
                    last = manager.recv(1000)
            assert last.startswith(b"STOPPING=1")
