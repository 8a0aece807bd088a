"""The in-process bus."""

import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import SimpleNamespace

from footfall.deploy.frames import Frames
from footfall.plant.bus import SimulatedBus


def test_a_guards_thread_and_the_loops_take_turns() -> None:
    """Without turns, both would step one simulation at once."""
    inside, at_once = [0], [0]

    def act(*_: object) -> list[Frames]:
        inside[0] += 1
        at_once.append(inside[0])
        time.sleep(0.01)
        inside[0] -= 1
        return []

    bus = SimulatedBus(SimpleNamespace(send=act, receive=act), SimpleNamespace(advance=act))  # type: ignore[arg-type]
    with ThreadPoolExecutor(3) as threads:
        for each in (bus.receive, bus.receive, partial(bus.send, None)):  # type: ignore[arg-type]
            threads.submit(each, 0)
    assert at_once == [0, 1, 1, 1, 1, 1]
