"""Deadline for foreign code in the loop's thread: a policy that sleeps or loops is interrupted."""

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Arm = Callable[[float], None]  # seconds from now; 0 removes the deadline


class OverdueError(BaseException):
    """The deadline has passed. A BaseException, because a policy may catch every Exception."""


def unarmed(_: float) -> None:
    """No deadline: time is simulated, or this thread receives no signals."""


@contextmanager
def deadlines() -> Iterator[Arm]:
    """Yields a function that sets a deadline: `OverdueError` interrupts Python code after it.

    Uses the signal of the interval timer, which only the main thread receives: other threads have no
    deadline. Native code is interrupted once it returns to Python; see `deploy/guard.py`.
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
        if time.monotonic() >= due_s:  # a signal from another source is ignored
            raise OverdueError

    before = signal.signal(signal.SIGALRM, overdue)
    try:
        yield arm
    finally:
        arm(0.0)
        signal.signal(signal.SIGALRM, before)
