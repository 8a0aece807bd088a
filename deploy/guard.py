"""A thread that brings the robot to rest when the loop's own thread hangs.

A deadline (`deploy/deadline.py`) interrupts Python. For code outside Python that never returns, such as a
driver that waits for ever, this thread damps the robot and disables its motors. It needs Python's lock: code
that keeps the lock leaves the robot to its motors' own timeout.
"""

import os
import sys
import threading
import time
from collections.abc import Callable

from footfall.common.in_time import in_time

PATIENCE_S = 1.0  # that the loop's thread has to end the process itself, once the motors are disabled
EVERY_S = 0.01  # between two frames
SAYING_S = 0.1


class Guard(threading.Thread):
    """A watchdog of the loop. Its heartbeat is the start of each tick."""

    def __init__(
        self,
        heartbeat: Callable[[], float],
        damp: Callable[[], None],
        disable: Callable[[], None],
        limit_s: float,
        damping_s: float,
        taken_over: threading.Event,
        end: Callable[[int], None] = os._exit,
    ) -> None:
        """Start watching.

        Args:
            heartbeat: when the loop last began a tick, by `time.perf_counter`, s.
            damp: sends one damping command.
            disable: disables the motors.
            limit_s: longest time between two heartbeats.
            damping_s: duration of damping before the motors are disabled.
            taken_over: set once the guard has taken the robot over from the loop.
            end: ends a process whose loop never came back.
        """
        super().__init__(name="guard", daemon=True)
        self._heartbeat, self._damp, self._disable, self._end = heartbeat, damp, disable, end
        self._limit_s, self._damping_s = limit_s, damping_s
        self._done = threading.Event()
        self._taken_over = taken_over
        self.start()

    def close(self) -> None:
        """The run is over."""
        self._done.set()
        self.join()

    def run(self) -> None:
        left_s = self._limit_s
        while not self._done.wait(left_s):
            left_s = self._heartbeat() + self._limit_s - time.perf_counter()  # infinite before the first beat
            if left_s < 0.0:
                self._take_over()
                return
            left_s = min(left_s, self._limit_s)

    def _take_over(self) -> None:
        self._taken_over.set()
        until = time.perf_counter() + self._damping_s
        while time.perf_counter() < until:
            _try(self._damp)
            time.sleep(EVERY_S)
        _try(self._disable)
        if self._done.wait(PATIENCE_S):
            return
        _say("the control loop did not come back: robot damped, motors off")
        self._end(1)


def _try(act: Callable[[], None]) -> None:
    """Act, and report what fails: the next act is tried in any case."""
    try:
        act()
    except Exception as error:
        _say(f"guard: {type(error).__name__}: {error}")


def _say(line: str) -> None:
    """Print a line, unless the terminal takes none: that must not hold up what the motors wait for."""
    in_time(lambda: print(line, file=sys.stderr, flush=True), SAYING_S)
