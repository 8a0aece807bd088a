"""Clock of the loop: simulated time, or wall-clock time."""

import ctypes
import gc
import os
import resource
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Protocol

LOCKSTEP_START_NS = 10**18  # 2001-09-09 01:46:40 UTC, start of simulated time
GIL_SWITCH_S = 1e-4  # longest time for which another thread keeps the GIL while the loop's thread waits

_MCL_CURRENT_AND_FUTURE = 3
_PR_SET_TIMERSLACK = 29
_CAP_IPC_LOCK = 14


class Clock(Protocol):
    """Times of the loop's ticks, in integer microseconds since the start."""

    realtime: bool

    def start(self) -> int:
        """Set time zero; returns its Unix time, ns, or `LOCKSTEP_START_NS` in lockstep."""
        ...

    def next_tick(self) -> int:
        """Wait for the next tick; returns its time."""
        ...

    def lateness_us(self) -> float:
        """Delay of the last tick's start."""
        ...


class LockstepClock:
    """Simulated time, without waiting between ticks."""

    realtime = False

    def __init__(self, period_us: int) -> None:
        self._period_us = period_us
        self._tick = -1

    def start(self) -> int:
        return LOCKSTEP_START_NS

    def next_tick(self) -> int:
        self._tick += 1
        return self._tick * self._period_us

    def lateness_us(self) -> float:
        return 0.0


class WallClock:
    """Wall-clock time with absolute deadlines. A missed tick is skipped."""

    realtime = True

    def __init__(self, period_us: int) -> None:
        self._period_ns = period_us * 1000
        self._start_ns = -1
        self._tick = -1
        self._late_ns = 0

    def start(self) -> int:
        self._start_ns = time.monotonic_ns()
        return time.time_ns()

    def next_tick(self) -> int:
        if self._start_ns < 0:
            self.start()
        now = time.monotonic_ns()
        self._tick = max(self._tick + 1, (now - self._start_ns) // self._period_ns)
        due = self._start_ns + self._tick * self._period_ns
        while (remaining_ns := due - time.monotonic_ns()) > 0:
            time.sleep(remaining_ns * 1e-9)  # from Python 3.11 on an absolute, uninterrupted clock_nanosleep
        self._late_ns = time.monotonic_ns() - due
        return self._tick * self._period_ns // 1000

    def lateness_us(self) -> float:
        return self._late_ns / 1000.0


@contextmanager
def realtime_thread(priority: int | None) -> Iterator[list[str]]:
    """Run this thread without garbage collection and, if permitted, with a real-time priority.

    Other threads of the process yield to it within 0.1 ms instead of Python's 5 ms. The kernel wakes it up on
    time instead of up to 50 us late.

    Args:
        priority: SCHED_FIFO priority, with locked memory; None changes neither.

    Yields:
        What the system did not permit, one line each. The loop then runs without it.
    """
    refused: list[str] = []
    switch_s = sys.getswitchinterval()
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(GIL_SWITCH_S)
    with ExitStack() as undo:
        undo.callback(gc.unfreeze)
        undo.callback(gc.enable)
        undo.callback(sys.setswitchinterval, switch_s)
        _set_timer_slack(1)
        undo.callback(_set_timer_slack, 0)  # original value
        if priority is not None:
            refused += filter(None, [_lock_memory(undo), _take_priority(priority, undo)])
        yield refused


def _lock_memory(undo: ExitStack) -> str:
    """Lock the process's memory against paging; returns the reason of a failure."""
    if not may_lock_memory():  # allocations beyond the limit would fail
        limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
        return f"memory is not locked: the limit (ulimit -l) is {limit / 2**20:.0f} MiB"
    library = ctypes.CDLL(None, use_errno=True)
    if library.mlockall(_MCL_CURRENT_AND_FUTURE):
        return f"memory is not locked: {os.strerror(ctypes.get_errno())}"
    undo.callback(library.munlockall)
    return ""


def may_lock_memory(status: Path = Path("/proc/self/status")) -> bool:
    """Whether all memory of this process may be locked: no limit, or the capability CAP_IPC_LOCK."""
    if resource.getrlimit(resource.RLIMIT_MEMLOCK)[0] == resource.RLIM_INFINITY:
        return True
    try:
        effective = status.read_text().partition("CapEff:")[2].split()[0]
    except (OSError, IndexError):
        return False
    return bool(int(effective, 16) >> _CAP_IPC_LOCK & 1)


def _take_priority(priority: int, undo: ExitStack) -> str:
    """Set real-time scheduling for this thread; returns the reason of a failure."""
    if not hasattr(os, "sched_setscheduler"):
        return "no real-time priority: this system has no SCHED_FIFO"
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        return f"no real-time priority {priority}: {error.strerror}"
    undo.callback(os.sched_setscheduler, 0, *before)
    return ""


def _set_timer_slack(slack_ns: int) -> None:
    """Set the kernel's timer slack for this thread; 0 for the default. Linux only."""
    with suppress(AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, ctypes.c_ulong(slack_ns), 0, 0, 0)
