"""Guard: a thread that stops the robot when the loop's own thread hangs.

A deadline (`deploy/deadline.py`) interrupts Python. For native code that never returns, such as a blocking
driver, this thread damps the robot and disables its motors. It needs the GIL: code that holds the GIL leaves
the robot to its motors' own timeout.
"""

import os
import sys
import threading
import time
from collections.abc import Callable

from footfall.common.blocking_threads import call_with_timeout

EXIT_TIMEOUT_S = 1.0  # time for the loop's thread to end the process itself, after the motors are disabled
FRAME_INTERVAL_S = 0.01  # between two frames
PRINT_TIMEOUT_S = 0.1


class Guard(threading.Thread):
    """Watchdog of the loop. The heartbeat is the start of each tick."""

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
            heartbeat: time of the last tick's start, by `time.perf_counter`, s.
            damp: sends one damping command.
            disable: disables the motors.
            limit_s: longest time between two heartbeats.
            damping_s: duration of damping before the motors are disabled.
            taken_over: set once the guard controls the robot instead of the loop.
            end: ends a process whose loop never returned.
        """
        super().__init__(name="guard", daemon=True)
        self._heartbeat, self._damp, self._disable, self._end = heartbeat, damp, disable, end
        self._limit_s, self._damping_s = limit_s, damping_s
        self._done = threading.Event()
        self._taken_over = taken_over
        self.start()

    def close(self) -> None:
        """Stop watching, at the end of the run."""
        self._done.set()
        self.join()

    def run(self) -> None:
        remaining_s = self._limit_s
        while not self._done.wait(remaining_s):
            remaining_s = (
                self._heartbeat() + self._limit_s - time.perf_counter()
            )  # infinite before the first tick
            if remaining_s < 0.0:
                self._take_over()
                return
            remaining_s = min(remaining_s, self._limit_s)

    def _take_over(self) -> None:
        self._taken_over.set()
        until = time.perf_counter() + self._damping_s
        while time.perf_counter() < until:
            _try(self._damp)
            time.sleep(FRAME_INTERVAL_S)
        _try(self._disable)
        if self._done.wait(EXIT_TIMEOUT_S):
            return
        _say("the control loop did not return: robot damped, motors disabled")
        self._end(1)


def _try(act: Callable[[], None]) -> None:
    """Call a function and report its failure: the next call is tried in any case."""
    try:
        act()
    except Exception as error:
        _say(f"guard: {type(error).__name__}: {error}")


def _say(line: str) -> None:
    """Print a line, unless the terminal is blocked, which must not delay commands to the motors."""
    call_with_timeout(lambda: print(line, file=sys.stderr, flush=True), PRINT_TIMEOUT_S)
