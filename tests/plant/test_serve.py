"""The simulated robot in a process of its own keeps the wall clock's time as long as the machine does."""

import threading
import time
from itertools import pairwise

import numpy as np

from footfall.deploy.frames import Frames
from footfall.plant.serve import LONGEST_STEP_US, not_before, serve


class Stub:
    """A body, its wires and a bus in one, with nothing on them; notes the times that it is told."""

    def __init__(self, stop: threading.Event, stall_s: float) -> None:
        self.times_us: list[int] = []
        self._stop, self._stall_s = stop, stall_s

    def advance(self, now_us: int) -> None:
        self.times_us.append(now_us)
        if len(self.times_us) == 20:
            time.sleep(self._stall_s)
        if len(self.times_us) == 40:
            self._stop.set()

    def receive(self, *_: object) -> list:
        return []


def served(stall_s: float) -> tuple[list[int], float]:
    """Times of 40 steps with a stall in their middle, us, and how long they took, s."""
    stop = threading.Event()
    stub = Stub(stop, stall_s)
    began = time.monotonic()
    serve(stub, stub, stub, stop)  # type: ignore[arg-type]
    return stub.times_us, time.monotonic() - began


def test_a_stall_is_not_made_up_for() -> None:
    times_us, took_s = served(stall_s=0.1)
    steps = [after - before for before, after in pairwise(times_us)]
    assert max(steps) <= LONGEST_STEP_US
    assert min(steps) > 0
    assert times_us[-1] * 1e-6 < took_s - 0.09


def test_without_one_it_keeps_to_the_clock_or_behind() -> None:
    times_us, took_s = served(stall_s=0.0)
    assert times_us[-1] * 1e-6 > 0.025
    assert times_us[-1] * 1e-6 <= took_s + 0.001


def arrived(times_us: list[float] | None) -> Frames:
    """Three frames, and when they came."""
    ids = np.array([1, 2, 3])
    when = None if times_us is None else np.array(times_us)
    return Frames(np.zeros(3, int), ids, np.zeros((3, 8), np.uint8), np.full(3, 8), when)


def test_what_came_during_a_stall_is_lost() -> None:
    left = not_before(arrived([100.0, 5000.0, 9000.0]), 5000)
    assert left.id.tolist() == [2, 3]
    assert left.time_us is not None
    assert left.time_us.tolist() == [5000.0, 9000.0]


def test_what_came_in_time_or_no_one_knows_when_is_passed_on_as_it_is() -> None:
    for frames in (arrived([5000.0, 6000.0, 9000.0]), arrived(None)):
        assert not_before(frames, 5000) is frames
