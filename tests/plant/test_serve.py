"""The simulated robot in a process of its own follows the wall clock as far as the machine permits."""

import threading
import time
from pathlib import Path
from types import SimpleNamespace
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


def test_a_stall_is_not_caught_up() -> None:
    """The 20th of 40 steps takes 0.1 s more. One object replaces body, wires and bus; no frames arrive."""
    times_us: list[int] = []
    stop = threading.Event()

    def advance(now_us: int) -> None:
        times_us.append(now_us)
        if len(times_us) == 20:
            time.sleep(0.1)
        if len(times_us) == 40:
            stop.set()

    robot: Any = SimpleNamespace(advance=advance, receive=lambda *_: [])
    began = time.monotonic()
    serve(robot, robot, robot, stop)
    took_s = time.monotonic() - began
    steps = np.diff(times_us)
    assert 0 < min(steps) <= max(steps) <= MAX_STEP_US
    assert times_us[-1] * 1e-6 < took_s - 0.09


def test_frames_that_arrive_during_a_stall_are_lost() -> None:
    times_us = np.array([100.0, 5000.0, 9000.0])
    batch = Frames(np.zeros(3, int), np.array([1, 2, 3]), np.zeros((3, 8), np.uint8), np.full(3, 8), times_us)
    kept = not_before(batch, 5000)
    assert kept.time_us is not None
    assert (kept.id.tolist(), kept.time_us.tolist()) == ([2, 3], [5000.0, 9000.0])


def test_options_reach_the_simulated_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    serving = MagicMock()
    monkeypatch.setattr(module, "serving", serving)
    options = "--robot hexapod --bus virtual --plant other.xml --motor-timeout 0.7 --duration 0.01"
    monkeypatch.setattr("sys.argv", ["serve", *options.split()])
    module.main()
    serving.return_value.__enter__.assert_called_once()
    robot, *settings = serving.call_args.args
    assert robot.name == "hexapod"
    assert settings == ["virtual", PlantConfig(Path("other.xml"), motor_timeout_s=0.7)]


@pytest.mark.parametrize("options", ["--robot nope", "extra", "--duration -1", "--motor-timeout nan"])
def test_bad_input_ends_in_one_line_as_on_the_command_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], options: str
) -> None:
    monkeypatch.setattr(module, "serving", MagicMock())
    monkeypatch.setattr("sys.argv", ["serve", "--duration", "0.01", *options.split()])
    with pytest.raises(SystemExit) as ended:
        module.main()
    (line,) = capsys.readouterr().err.splitlines()
    assert (ended.value.code, line.partition(": ")[0]) == (2, "footfall")


def test_the_bus_closes_after_the_robots_thread(go1: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[Any] = []
    threads_at_close: list[int] = []

    def close() -> None:
        threads_at_close.append(sum(thread.name == "robot" for thread in threading.enumerate()))

    def open_bus(interface: str, names: tuple[str, ...], filters: Any) -> Any:
        opened.append((interface, names))
        return SimpleNamespace(receive=lambda _: [], send=lambda *_: None, close=close)

    monkeypatch.setattr(module, "open_interfaces", open_bus)
    with module.serving(go1, "vcan", PlantConfig(sample={"encoder_bias": np.full(12, 0.25)})) as body:
        np.testing.assert_array_equal(body.encoder_bias, 0.25)
    assert (opened, threads_at_close) == ([("vcan", wiring_of(go1).buses)], [0])
