"""State of a running control loop, displayed by another thread."""

import os
import termios
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import IO

import numpy as np
from rich.console import Console
from rich.live import Live
from rich.text import Text

from footfall.common.limits import MAX_DURATION_S
from footfall.common.rotations import tilt
from footfall.deploy.loop import ControlLoop
from footfall.service_manager import notifying_service_manager

UPDATES_PER_S = 5  # on a terminal
LINE_INTERVAL_S = 5.0  # on any other output
OUTPUT_TIMEOUT_S = 1.0  # for an output that is blocked


@contextmanager
def live_state(
    loop: ControlLoop,
    velocity: Callable[[], np.ndarray],
    duration_s: float,
    console: Console | None = None,
    steering: Callable[[], str] = lambda: "",
) -> Iterator[None]:
    """Show a loop's state while the context is open: in place on a terminal, else line by line.

    A service manager gets the state, too.

    Args:
        loop: the loop; another thread reads its state.
        velocity: the base's velocity, m/s, body frame, (3,); NaN if unknown.
        duration_s: longest walking time.
        console: output; None for the standard output.
        steering: returns a second line, about the steering; empty for none.
    """
    console = console or Console()
    ended = threading.Event()

    def state() -> Text:
        lines = describe(loop, velocity(), duration_s), steering()
        return Text("\n".join(filter(None, lines)))

    def draw() -> None:
        with Live(
            state(), console=console, auto_refresh=False, transient=True, redirect_stdout=False,
            redirect_stderr=False,
        ) as live:  # fmt: skip
            while not ended.wait(1.0 / UPDATES_PER_S):
                live.update(state(), refresh=True)

    def print_lines() -> None:
        while not ended.wait(LINE_INTERVAL_S):
            console.print(state(), highlight=False)

    def show() -> None:
        with suppress(OSError, SystemExit):  # the result is reported elsewhere, too
            (draw if console.is_terminal else print_lines)()

    thread = threading.Thread(target=show, name="live state", daemon=True)
    thread.start()
    try:
        with notifying_service_manager(loop):
            yield
    finally:
        ended.set()
        resume_output(console.file)
        thread.join(OUTPUT_TIMEOUT_S)


def resume_output(output: IO[str]) -> None:
    """Resume a terminal's output after Ctrl-S, so that the final messages are visible."""
    with suppress(OSError, ValueError, termios.error):  # not a terminal, or a closed one
        if os.tcgetpgrp(output.fileno()) == os.getpgrp():  # in the background it would stop the process
            termios.tcflow(output.fileno(), termios.TCOOFF)  # Linux resumes only what this call has stopped
            termios.tcflow(output.fileno(), termios.TCOON)


def describe(loop: ControlLoop, velocity: np.ndarray, duration_s: float) -> str:
    """State of the loop in one line."""
    walking_s = loop.walking_s if loop.walking else loop.walked_s
    hold = "hold the robot up: " if loop.held_up else ""
    parts = [
        f"{walking_s:.1f} s" if duration_s >= MAX_DURATION_S else f"{walking_s:.1f} of {duration_s:g} s",
        loop.state.mode.value,
        "command {:+.2f} {:+.2f} m/s {:+.2f} rad/s".format(*loop.requested_command),
    ]
    if np.isfinite(velocity).all():
        parts.append("velocity {:+.2f} {:+.2f} m/s".format(*velocity[:2]))
    if (battery := loop.battery).known:
        parts.append(f"battery {battery.charge:.0%}")
    skipped = _count(loop.timing.ticks_skipped, "tick")
    parts += [f"tilt {tilt(loop.sensed.quaternion):.2f} rad", f"{skipped} skipped"]
    return hold + ", ".join(parts)


def _count(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
