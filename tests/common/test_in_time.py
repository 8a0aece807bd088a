"""Calls with a time limit."""

import threading

from footfall.common.in_time import call_in_time


def test_a_call_that_ends_returns_none_or_its_error() -> None:
    wrong = OSError("full")

    def fail() -> None:
        raise wrong

    assert call_in_time(lambda: None) is None
    assert call_in_time(fail) is wrong


def test_a_call_that_does_not_end_is_a_timeout() -> None:
    began, ended = threading.Event(), threading.Event()
    caller: list[threading.Thread] = []

    def wait() -> None:
        caller.append(threading.current_thread())
        began.set()
        ended.wait()

    try:
        assert isinstance(call_in_time(wait, 0.01), TimeoutError)
    finally:  # a command line in this process would not flush its output while it waits
        ended.set()
        began.wait()
        caller[0].join()
