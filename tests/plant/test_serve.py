"""The simulated robot in a process of its own follows the wall clock as far as the machine permits."""

import threading
import time
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest

from footfall.deploy.frames import Frames
from footfall.deploy.wiring import wiring_of
from footfall.plant import serve as module
from footfall.plant.robot import PlantConfig
from footfall.plant.serve import MAX_STEP_US, not_before, serve
from footfall.robots.description import Robot


class Stub:
    """A body, its wires and a bus in one, without frames; records its times."""

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
    """Times of 40 steps with a stall in their middle, us, and their duration, s."""
    stop = threading.Event()
    stub = Stub(stop, stall_s)
    began = time.monotonic()
    serve(stub, stub, stub, stop)  # type: ignore[arg-type]
    return stub.times_us, time.monotonic() - began


def test_a_stall_is_not_caught_up() -> None:
    times_us, took_s = served(stall_s=0.1)
    steps = np.diff(times_us)
    assert 0 < min(steps) <= max(steps) <= MAX_STEP_US
    assert times_us[-1] * 1e-6 < took_s - 0.09


def test_frames_that_arrive_during_a_stall_are_lost() -> None:
    times_us = np.array([100.0, 5000.0, 9000.0])
    batch = Frames(np.zeros(3, int), np.array([1, 2, 3]), np.zeros((3, 8), np.uint8), np.full(3, 8), times_us)
    left = not_before(batch, 5000)
    assert left.time_us is not None
    assert (left.id.tolist(), left.time_us.tolist()) == ([2, 3], [5000.0, 9000.0])


def test_options_reach_the_simulated_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    serving = MagicMock()
    monkeypatch.setattr(module, "serving", serving)
    options = "--robot hexapod --bus virtual --plant other.xml --motor-timeout 0.7 --duration 0.0"
    monkeypatch.setattr("sys.argv", ["serve", *options.split()])
    module.main()
    serving.return_value.__enter__.assert_called_once()
    robot, *settings = serving.call_args.args
    assert robot.name == "hexapod"
    assert settings == ["virtual", PlantConfig(Path("other.xml"), motor_timeout_s=0.7)]


def test_the_plant_has_its_settings_and_ends_with_it(go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []

    class Bus:
        def __init__(self, interface: str, names: tuple[str, ...], filters: Any) -> None:
            made.append((interface, names))

        def receive(self, now_us: int) -> list[Frames]:
            return []

        def send(self, frames: Frames, now_us: int) -> None: ...

        def close(self) -> None:
            made.append(sum(thread.name == "robot" for thread in threading.enumerate()))

    monkeypatch.setattr(module, "open_interfaces", Bus)
    with module.serving(go1, "vcan", PlantConfig(sample={"encoder_bias": np.full(12, 0.25)})) as body:
        np.testing.assert_array_equal(body.encoder_bias, 0.25)
    assert made == [("vcan", wiring_of(go1).buses), 0]  # closed once it is unused
