"""What `footfall deploy` shows while it runs."""

import io
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from deploy_policies import Hold, short_episode
from rich.console import Console
from scipy.spatial.transform import Rotation

import footfall.live_state
from footfall.deploy.battery import BatteryState
from footfall.deploy.loop import ControlLoop
from footfall.live_state import describe, live_state
from footfall.plant.episode import run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.robots.description import Robot


def walk(robot: Robot, console: Console, slow_s: float = 0.0) -> list[str]:
    """Walks for half a second with the display on; returns the state at each tick in words."""
    states = []

    def display(loop: ControlLoop, velocity):
        return live_state(loop, velocity, 0.5, console)

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        states.append(describe(loop, body.truth().base_velocity, 0.5))
        time.sleep(slow_s)

    command = np.array([0.3, 0.0, -0.1])
    run_episode(
        robot,
        Hold(robot),
        short_episode(duration_s=0.5, command_source=lambda _: command, display=display),
        watch,
    )
    return states


def test_a_state_says_when_what_how_fast_and_how_late(go1: Robot) -> None:
    states = walk(go1, Console(file=io.StringIO()))
    assert states[0].startswith("0.0 of 0.5 s, IDLE")
    middle = next(state for state in states if state.startswith("0.3 of 0.5 s, WALKING"))
    assert "command +0.30 +0.00 m/s -0.10 rad/s" in middle
    assert "velocity +0.0" in middle or "velocity -0.0" in middle
    assert middle.endswith("tilt 0.00 rad, 0 ticks late")
    assert states[-1].startswith("0.5 of 0.5 s, RELEASING")


def test_a_velocity_that_nobody_knows_is_left_out(go1: Robot) -> None:
    loops: list[ControlLoop] = []
    run_episode(go1, Hold(go1), short_episode(duration_s=0.1), lambda loop, _: loops.append(loop))
    for unknown in (np.full(3, np.nan), np.array([0.1, np.nan, 0.0])):
        assert "velocity" not in describe(loops[-1], unknown, 0.1)


@pytest.mark.parametrize(("walking", "told"), [(True, "1.3 of 2.5 s"), (False, "4.2 of 2.5 s")])
def test_every_part_of_a_state_is_its_own(walking: bool, told: str) -> None:
    """In numbers that all differ; the robot leans by 0.3 rad and looks elsewhere."""
    attitude = Rotation.from_euler("ZX", [1.1, 0.3]).as_quat()[[3, 0, 1, 2]]
    loop = SimpleNamespace(
        walking=walking, walking_s=1.26, walked_s=4.2,
        state=SimpleNamespace(mode=SimpleNamespace(value="WALKING")),
        asked_command=(0.5, -0.25, 0.75), sensed=SimpleNamespace(quaternion=attitude),
        ticks_skipped=7, held_up=False, battery=BatteryState(charge=0.42),
    )  # fmt: skip
    assert describe(loop, np.array([0.11, -0.22, 9.0]), 2.5) == (  # type: ignore[arg-type]
        f"{told}, WALKING, command +0.50 -0.25 m/s +0.75 rad/s, velocity +0.11 -0.22 m/s,"
        " battery 42%, tilt 0.30 rad, 7 ticks late"
    )


def test_away_from_a_terminal_there_are_plain_lines_now_and_then(
    go1: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(footfall.live_state, "LINE_EVERY_S", 0.1)
    out = io.StringIO()
    walk(go1, Console(file=out, width=200), slow_s=0.001)
    lines = out.getvalue().splitlines()
    assert len(lines) >= 2
    assert "live state" not in {thread.name for thread in threading.enumerate()}
    assert all(" of 0.5 s, " in line and "\x1b" not in line for line in lines)


def test_on_a_terminal_the_state_is_shown_in_place_and_wiped_at_the_end(go1: Robot) -> None:
    out = io.StringIO()
    walk(go1, Console(file=out, force_terminal=True, width=200), slow_s=0.001)
    assert "WALKING" in out.getvalue()
    assert out.getvalue().rstrip("\n").endswith("\x1b[2K")  # the line has been erased
