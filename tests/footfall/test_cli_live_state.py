"""How a run's state is shown beside it, with a loop that only has a state."""

import io
import threading
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from footfall import live_state as module
from footfall.live_state import describe, live_state


@pytest.fixture
def loop() -> Any:
    return SimpleNamespace(
        walking=True, walking_s=1.0, walked_s=0.0, ticks_skipped=0,
        state=SimpleNamespace(mode=SimpleNamespace(value="WALKING")),
        asked_command=(0.5, 0.0, 0.0), sensed=SimpleNamespace(quaternion=np.array([1.0, 0, 0, 0])),
    )  # fmt: skip


def unknown() -> np.ndarray:
    return np.full(3, np.nan)


def test_on_a_terminal_it_is_drawn_five_times_a_second_and_does_not_stay(
    loop: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[dict[str, Any]] = []

    class Screen:
        def __init__(self, **how: Any) -> None:
            made.append(how)

        def __enter__(self) -> None:
            made.append({})

        def __exit__(self, *_: object) -> None:
            made.append({})

    monkeypatch.setattr(module, "Live", Screen)
    console = Console(file=io.StringIO(), force_terminal=True)
    with live_state(loop, unknown, 2.5, console):
        assert len(made) == 2
    how = made[0]
    assert len(made) == 3
    assert how.pop("get_renderable")().plain == describe(loop, unknown(), 2.5)
    assert how == {"console": console, "refresh_per_second": 5, "transient": True}


def test_a_full_disk_is_told_by_others(loop: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """The thread that prints ends; nobody hears of it twice."""
    tried, errors = threading.Event(), []
    monkeypatch.setattr(module, "LINE_EVERY_S", 0.001)
    monkeypatch.setattr(threading, "excepthook", errors.append)

    def full(*_: Any, **__: Any) -> None:
        tried.set()
        raise OSError(28, "No space left on device")

    console: Any = SimpleNamespace(is_terminal=False, print=full)
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
