"""Runs a loop from start to end, with a guard and real-time settings."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from footfall.common.collector import collector_paused
from footfall.deploy.clock import realtime_thread
from footfall.deploy.guard import Guard
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.deploy.safety_config import SafetyConfig

EachTick = Callable[[ControlLoop], None]


@contextmanager
def realtime_settings(realtime: bool, priority: int | None) -> Iterator[list[str]]:
    """Real-time settings of the system; in lockstep only the garbage collector pauses.

    Yields:
        What the system did not permit, one line each.
    """
    if realtime:
        with realtime_thread(priority) as refused:
            yield refused
    else:
        with collector_paused():
            yield []


def run_loop(loop: ControlLoop, duration_s: float, damping_ticks: int, each_tick: EachTick | None) -> None:
    """Tick until the run is over. After an exception the robot is damped, then the exception is raised again.

    Args:
        loop: loop that has not started.
        duration_s: longest walking time.
        damping_ticks: largest number of ticks until a robot is damped and its motors are disabled.
        each_tick: called after each tick; None for nothing.
    """
    try:
        while loop.tick():
            if each_tick is not None:
                each_tick(loop)
            if loop.state.mode is Mode.WALKING and loop.walking_s >= duration_s - 1e-9:
                loop.finish()
    except BaseException as error:
        loop.fail(error)
        _damp(loop, damping_ticks)
        raise


def _damp(loop: ControlLoop, ticks: int) -> None:
    """Tick a failed loop until the robot was damped long enough, despite further exceptions."""
    for _ in range(ticks):
        try:
            if not loop.tick():
                return
        except BaseException as error:
            loop.fail(error)


@contextmanager
def guarded(
    loop: ControlLoop, taken_over: threading.Event, realtime: bool, safety: SafetyConfig
) -> Iterator[None]:
    """Run a guard beside a loop in real time; it sets `taken_over`."""
    if not realtime:
        yield
        return
    guard = Guard(
        lambda: loop.heartbeat_s,
        loop.damp,
        loop.shut_down,
        safety.guard_after_s,
        safety.damping_s,
        taken_over,
    )
    try:
        yield
    finally:
        guard.close()
