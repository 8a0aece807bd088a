"""What a running control loop is doing, shown a few times a second from beside it."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from footfall.common.rotations import tilt
from footfall.deploy.loop import ControlLoop

PER_SECOND = 5  # on a terminal
LINE_EVERY_S = 5.0  # elsewhere


@contextmanager
def live_state(
    loop: ControlLoop, velocity: Callable[[], np.ndarray], duration_s: float, console: Console | None = None
) -> Iterator[None]:
    """Show a loop's state for as long as the context lasts: in place on a terminal, else line by line.

    Args:
        loop: the loop; it is only looked at, from another thread.
        velocity: the base's velocity, m/s, body frame, (3,); NaN if unknown.
        duration_s: how long it shall walk.
        console: where to show it.
    """
    console = console or Console()

    def state() -> Text:
        return Text(describe(loop, velocity(), duration_s))

    if console.is_terminal:
        with Live(get_renderable=state, console=console, refresh_per_second=PER_SECOND, transient=True):
            yield
        return
    ended = threading.Event()

    def print_lines() -> None:
        with suppress(OSError):  # the command itself reports a full disk, in one line
            while not ended.wait(LINE_EVERY_S):
                console.print(state(), highlight=False)

    thread = threading.Thread(target=print_lines, name="live state", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def describe(loop: ControlLoop, velocity: np.ndarray, duration_s: float) -> str:
    """The state in one line."""
    walking_s = loop.walking_s if loop.walking else loop.walked_s
    parts = [
        f"{walking_s:.1f} of {duration_s:g} s",
        loop.state.mode.value,
        "command {:+.2f} {:+.2f} m/s {:+.2f} rad/s".format(*loop.asked_command),
    ]
    if np.isfinite(velocity).all():
        parts.append("velocity {:+.2f} {:+.2f} m/s".format(*velocity[:2]))
    parts += [f"tilt {tilt(loop.sensed.quaternion):.2f} rad", f"{loop.ticks_skipped} ticks late"]
    return ", ".join(parts)
