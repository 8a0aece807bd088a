"""The in-process bus."""

import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from types import SimpleNamespace

import numpy as np

from footfall.deploy.frames import Frames
from footfall.deploy.wiring import wiring_of
from footfall.plant.bus import SimulatedBus
from footfall.plant.wires import Side, SimulatedWires
from footfall.robots.description import Robot


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


def test_frames_refused_by_a_full_wire_count_for_the_host(go1: Robot) -> None:
    wires = SimulatedWires(wiring_of(go1).buses, host_queue=3)
    bus = SimulatedBus(wires, SimpleNamespace(time_us=1000))  # type: ignore[arg-type]
    channel = np.array([1] * 5 + [2] * 4)
    frames = Frames(channel, np.full(9, 1), np.zeros((9, 8), np.uint8), np.full(9, 8))
    wires.send(Side.HOST, frames, 0)
    wires.refused[Side.ROBOT] = [7, 8, 9, 10]
    assert [statistics.frames_refused for statistics in bus.statistics()] == [0, 2, 1, 0]
