"""How a run's state is shown beside it, with a loop that only has a state."""

import io
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from footfall import live_state as module
from footfall.deploy.battery import NO_BATTERY
from footfall.live_state import live_state


@pytest.fixture
def loop() -> Any:
    return SimpleNamespace(
        walking=True, walking_s=1.0, walked_s=0.0, ticks_skipped=0, held_up=False,
        state=SimpleNamespace(mode=SimpleNamespace(value="WALKING")),
        battery=NO_BATTERY, asked_command=(0.5, 0.0, 0.0),
        sensed=SimpleNamespace(quaternion=np.array([1.0, 0, 0, 0])),
    )  # fmt: skip


def unknown() -> np.ndarray:
    return np.full(3, np.nan)


def test_a_full_disk_is_told_by_others(loop: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The thread that prints ends; nobody hears of it twice."""
    tried, errors = threading.Event(), []
    monkeypatch.setattr(module, "LINE_EVERY_S", 0.001)
    monkeypatch.setattr(threading, "excepthook", errors.append)

    def full(*_: Any, **__: Any) -> None:
        tried.set()
        raise OSError(28, "No space left on device")

    console: Any = SimpleNamespace(is_terminal=False, print=full, file=io.StringIO())
    with live_state(loop, unknown, 2.5, console):
        assert tried.wait(10.0)
    assert errors == []


def test_its_lines_end_with_what_it_shows_also_where_that_fails(loop: Any) -> None:
    out, threads = io.StringIO(), []

    def fails() -> None:
        with live_state(loop, unknown, 2.5, Console(file=out)):
            threads.extend(each for each in threading.enumerate() if each.name == "live state")
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fails()
    (thread,) = threads
    assert thread.daemon
    assert not thread.is_alive()
    assert out.getvalue() == ""  # the first line would have come after five seconds
