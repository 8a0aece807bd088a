"""A deadline for foreign code on the loop's own thread: a policy that sleeps or spins is interrupted."""

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Arm = Callable[[float], None]  # seconds from now; 0 removes the deadline


class OverdueError(BaseException):
    """The deadline has passed. A BaseException, since a policy may catch every Exception."""


def unarmed(_: float) -> None:
    """No deadline: time is simulated, or this thread gets no signals."""


@contextmanager
def deadlines() -> Iterator[Arm]:
    """Yields a function that sets a deadline: `OverdueError` interrupts Python code that is past it.

    Uses the signal of the interval timer, which reaches the main thread alone: other threads get no deadline.
    Code outside Python is interrupted once it returns to Python; see `deploy/guard.py`.
    """
    if threading.current_thread() is not threading.main_thread():
        yield unarmed
        return

    due_s = math.inf

    def arm(seconds: float) -> None:
        nonlocal due_s
        due_s = time.monotonic() + seconds if seconds else math.inf
        signal.setitimer(signal.ITIMER_REAL, seconds)

    def overdue(*_: object) -> None:
        if time.monotonic() >= due_s:  # a signal from elsewhere is none of the deadline's
            raise OverdueError

    before = signal.signal(signal.SIGALRM, overdue)
    try:
        yield arm
    finally:
        arm(0.0)
        signal.signal(signal.SIGALRM, before)
