"""Threads for which Python would wait at its exit: calls that may block, and compilers."""

import threading
from collections.abc import Callable

TIMEOUT_S = 2.0
COMPILER = "compile"  # prefix of the names of threads that compile
_CALL = "call that may block"


def call_with_timeout(call: Callable[[], None], timeout_s: float = TIMEOUT_S) -> BaseException | None:
    """Call a function in its own thread, and wait at most `timeout_s` for its end.

    A stopped terminal (Ctrl-S), a hanging connection or a pipe without a reader would otherwise block the
    caller for ever.

    Returns:
        The exception that the call raised; a TimeoutError if it has not returned; else None.
    """
    raised: list[BaseException] = []

    def run() -> None:
        try:
            call()
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=run, name=_CALL, daemon=True)
    thread.start()
    thread.join(timeout_s)
    if thread.is_alive():
        return TimeoutError(f"blocked for more than {timeout_s:g} s")
    return raised[0] if raised else None


def any_call_blocked() -> bool:
    """Whether a call has not returned yet: an exit that flushes outputs would wait for it."""
    return any(thread.name == _CALL for thread in threading.enumerate())


def any_compiling() -> bool:
    """Whether a thread compiles: after Ctrl-C the process exits without waiting for it."""
    return any(thread.name.startswith(COMPILER) for thread in threading.enumerate())
