"""Signals, and `os._exit` in foreign code, end the run properly, instead of killing the process.

Otherwise only the motors' timeouts would stop the robot, and there would be no result.
"""

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NoReturn

# Ctrl-C, `kill`, a closed terminal (a lost SSH connection), Ctrl-\, and all other signals that end a process
# without a handler. SIGALRM is for the deadline.
ENDING = tuple(
    getattr(signal, name)
    for name in (
        "SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGXCPU", "SIGVTALRM", "SIGPROF",
        "SIGIO", "SIGPWR", "SIGSTKFLT",
    )
    if hasattr(signal, name)
)  # fmt: skip
ONCE = (signal.SIGHUP,)  # both kernel and shell send it when a terminal closes: it counts once


@contextmanager
def ending_on_signals(finish: Callable[[], None]) -> Iterator[None]:
    """While the context is open, signals that would end the process call `finish`, which ends the run
    properly.

    A second signal calls `finish` again, which skips lying down. Signals in `ONCE` count once.
    """
    hung_up = False  # no lock: a second signal may interrupt the handler, which would wait for itself

    def end(number: int, _: object) -> None:
        nonlocal hung_up
        if number in ONCE:
            if hung_up:
                return
            hung_up = True
        finish()

    with handling(end):
        yield


@contextmanager
def handling(handler: Callable[[int, object], None]) -> Iterator[None]:
    """Set this handler for signals that would end the process; only in the main thread, which receives
    them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handler) for number in ENDING}
    try:
        yield
    finally:
        for number, earlier in before.items():
            signal.signal(number, earlier)


@contextmanager
def exit_raises() -> Iterator[None]:
    """`os._exit` raises SystemExit: then a policy that calls it has failed, and the robot is damped.

    A forked copy of the process can exit normally. Native code can still end the process.
    """
    end, process = os._exit, os.getpid()

    def refuse(status: int) -> NoReturn:
        if os.getpid() != process:
            end(status)
        raise SystemExit(f"os._exit({status}) was called")

    os._exit = refuse
    try:
        yield
    finally:
        os._exit = end
