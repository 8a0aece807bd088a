"""Notifications of a run to a service manager, with a socket in place of systemd's."""

import socket
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

from footfall.deploy.battery import BatteryState
from footfall.deploy.safety import State
from footfall.service_manager import notifying_service_manager


@pytest.fixture
def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(5.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "40000")
        yield manager


def run(heartbeat_s: float) -> SimpleNamespace:
    return SimpleNamespace(state=State(), battery=BatteryState(charge=0.42), heartbeat_s=heartbeat_s)


@pytest.mark.parametrize(("age_s", "alive"), [(0.0, True), (10.0, False)])
def test_the_service_manager_gets_heartbeats_while_the_loop_ticks(
    manager: socket.socket, age_s: float, alive: bool
) -> None:
    with notifying_service_manager(run(time.perf_counter() - age_s)):  # type: ignore[arg-type]
        first, second = manager.recv(1000), manager.recv(1000)
    assert first == b"READY=1\nSTATUS=IDLE, battery 42%"
    assert (b"WATCHDOG=1" in second) is alive
    manager.settimeout(0.0)
    *_, last = iter(lambda: receive(manager), b"")
    assert last.startswith(b"STOPPING=1")


def receive(manager: socket.socket) -> bytes:
    try:
        return manager.recv(1000)
    except BlockingIOError:
        return b""


def test_without_a_service_manager_nothing_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    with notifying_service_manager(run(0.0)):  # type: ignore[arg-type]
        pass
