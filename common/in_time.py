"""Calls that may block, such as a write to a terminal, with a time limit."""

import threading
from collections.abc import Callable

TIME_LIMIT_S = 2.0
COMPILING = "compile"  # prefix of the names of threads that compile
_NAME = "call that may block"


def call_in_time(act: Callable[[], None], timeout_s: float = TIME_LIMIT_S) -> BaseException | None:
    """Call `act` in a thread of its own, and wait at most `timeout_s` for its end.

    A stopped terminal (Ctrl-S), a hanging connection or a pipe without a reader would otherwise block the
    caller for ever.

    Returns:
        The exception that `act` raised; a TimeoutError if it has not returned; else None.
    """
    raised: list[BaseException] = []

    def run() -> None:
        try:
            act()
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=run, name=_NAME, daemon=True)
    thread.start()
    thread.join(timeout_s)
    if thread.is_alive():
        return TimeoutError("it accepts no output")
    return raised[0] if raised else None


def any_blocked() -> bool:
    """Whether a call has not returned yet: an exit that flushes outputs would wait for it."""
    return any(thread.name == _NAME for thread in threading.enumerate())


def any_compiling() -> bool:
    """Whether a thread compiles: an interrupted process leaves without its result."""
    return any(thread.name.startswith(COMPILING) for thread in threading.enumerate())
