"""A deadline for work of others on the robot's own thread: a policy that sleeps or spins is interrupted."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Arm = Callable[[float], None]  # seconds from now on; 0 takes the deadline away


class OverdueError(BaseException):
    """The deadline has passed. No `Exception`: code that catches all of those may not swallow it."""


def unarmed(_: float) -> None:
    """No deadline, where time is simulated or signals are not ours to use."""


@contextmanager
def deadlines() -> Iterator[Arm]:
    """What sets a deadline: Python code that is past it is interrupted by `OverdueError`.

    It takes the signal of the interval timer, which reaches the main thread alone: elsewhere there is none.
    Code outside Python is interrupted once it returns to it; see `deploy/guard.py`.
    """
    if threading.current_thread() is not threading.main_thread():
        yield unarmed
        return

    def overdue(*_: object) -> None:
        raise OverdueError

    before = signal.signal(signal.SIGALRM, overdue)
    try:
        yield _set
    finally:
        _set(0.0)
        signal.signal(signal.SIGALRM, before)


def _set(seconds: float) -> None:
    signal.setitimer(signal.ITIMER_REAL, seconds)
