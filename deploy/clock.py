"""The loop's time: as fast as it goes, or as the wall clock goes."""

import ctypes
import gc
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Protocol

_MCL_CURRENT_AND_FUTURE = 3


class Clock(Protocol):
    """Hands out the times of the loop's ticks, in whole microseconds since it started."""

    realtime: bool

    def next_tick(self) -> int:
        """Wait for the next tick; returns its time."""
        ...

    def lateness_us(self) -> float:
        """How much later than due the last tick began."""
        ...


class LockstepClock:
    """Simulated time: each tick follows at once."""

    realtime = False

    def __init__(self, period_us: int) -> None:
        self._period_us = period_us
        self._tick = -1

    def next_tick(self) -> int:
        self._tick += 1
        return self._tick * self._period_us

    def lateness_us(self) -> float:
        return 0.0


class WallClock:
    """Wall time, paced by absolute deadlines. A tick that was missed is skipped, not caught up on."""

    realtime = True

    def __init__(self, period_us: int) -> None:
        self._period_ns = period_us * 1000
        self._start_ns = -1
        self._tick = -1
        self._late_ns = 0

    def next_tick(self) -> int:
        now = time.monotonic_ns()
        if self._start_ns < 0:
            self._start_ns = now
        self._tick = max(self._tick + 1, (now - self._start_ns) // self._period_ns)
        due = self._start_ns + self._tick * self._period_ns
        while (left := due - time.monotonic_ns()) > 0:
            time.sleep(left * 1e-9)  # an absolute, uninterrupted clock_nanosleep from Python 3.11 on
        self._late_ns = time.monotonic_ns() - due
        return self._tick * self._period_ns // 1000

    def lateness_us(self) -> float:
        return self._late_ns / 1000.0


@contextmanager
def undisturbed(priority: int | None) -> Iterator[None]:
    """Run without garbage collection and, where the system lets us, at a real-time priority.

    Args:
        priority: SCHED_FIFO priority, and memory locked; None leaves both alone. A system that refuses is
            no error: the loop then runs as well as it can.
    """
    gc.collect()
    gc.freeze()
    gc.disable()
    before = None
    if priority is not None:
        with suppress(OSError):
            ctypes.CDLL(None).mlockall(_MCL_CURRENT_AND_FUTURE)
        with suppress(OSError, AttributeError):
            before = os.sched_getscheduler(0), os.sched_getparam(0)
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    try:
        yield
    finally:
        if before is not None:
            with suppress(OSError):
                os.sched_setscheduler(0, *before)
            ctypes.CDLL(None).munlockall()
        gc.enable()
        gc.unfreeze()
