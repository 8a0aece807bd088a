"""`footfall bring-up`: what it passes to its steps, their order, questions and results. No step is run."""

import json
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from shell import Shell

from footfall.deploy.bring_up.steps import STEPS, Setting, Step, Verdict
from footfall.deploy.session import SessionResult
from footfall.verbs import bring_up

RESULT = SessionResult("IDLE", (), 1.0, 2.5, 3.0, np.zeros(1), {}, (), ("a note",), (), "")
Run = tuple[str, Setting, str]


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[Run]:
    """Each step that was run, its setting and its bus; `stand` fails below half of the torque."""
    given: list[Run] = []

    def run_step(step: Step, setting: Setting, bus: str) -> Verdict:
        given.append((step.name, setting, bus))
        fails = step.name == "stand" and setting.deploy.scale < 0.5
        return Verdict(step.name, ("the robot is tilted", "a foot hangs") if fails else (), RESULT)

    monkeypatch.setattr(bring_up, "_run_step", run_step)
    return given


def written() -> dict[str, Any]:
    return dict(json.loads(Path("a.json").read_text()))


def test_the_default_is_all_steps_of_go1_in_simulation(shell: Shell, runs: list[Run]) -> None:
    done = shell("bring-up", "stand", "--json", "a.json")
    assert (done.status, done.err) == (0, "")
    assert done.out.splitlines() == [f"{step.name}: {step.about}: passed" for step in STEPS]
    assert [(step, bus) for step, _, bus in runs] == [(step.name, "sim") for step in STEPS]
    setting = runs[0][1]
    assert (setting.robot.name, setting.policy.name, setting.realtime) == ("go1", "stand", False)
    assert written().items() >= {"robot": "go1", "bus": "sim", "scale": 0.5}.items()


def test_robot_policy_bus_and_loop_can_be_chosen(shell: Shell, runs: list[Run]) -> None:
    Path("loop.yaml").write_text("stand_s: 2.5")
    options = ("--robot", "hexapod", "--bus", "slcan", "--yes", "--config", "loop.yaml", "--json", "a.json")
    assert shell("bring-up", "tripod", "--steps", "walk", "--scale", "0.7", *options).status == 0
    ((step, setting, bus),) = runs
    assert (step, bus, setting.realtime) == ("walk", "slcan", True)
    assert (setting.robot.name, setting.policy.name) == ("hexapod", "tripod")
    assert (setting.deploy.stand_s, setting.deploy.scale) == (2.5, 0.7)
    assert written().items() >= {"robot": "hexapod", "bus": "slcan", "scale": 0.7}.items()


def test_steps_run_in_their_own_order(shell: Shell, runs: list[Run]) -> None:
    """The robot does not walk before all other requested steps have passed."""
    for typed in ("walk,hold,legs", "legs,hold,walk", "hold,walk,hold,legs"):
        runs.clear()
        assert shell("bring-up", "stand", "--steps", typed).status == 0
        assert [step for step, *_ in runs] == ["hold", "legs", "walk"]


def test_no_step_runs_after_a_failed_step(shell: Shell, runs: list[Run]) -> None:
    done = shell("bring-up", "stand", "--scale", "0.25", "--json", "a.json")
    steps = [step for step, *_ in runs]
    assert (done.status, steps) == (1, ["hold", "joints", "legs", "wiring", "stand"])
    assert {"the robot is tilted", "a foot hangs"} <= {line.strip(" -") for line in done.out.splitlines()}
    results = written()["steps"]
    assert [(each["step"], each["passed"]) for each in results] == [(step, step != "stand") for step in steps]
    assert results[-1] == {
        "step": "stand", "passed": False, "findings": ["the robot is tilted", "a foot hangs"],
        "final_state": "IDLE", "run_s": 2.5, "notes": ["a note"],
    }  # fmt: skip


def test_a_biped_skips_the_step_that_needs_three_feet(shell: Shell, runs: list[Run]) -> None:
    done = shell("bring-up", "stand", "--robot", "g1", "--steps", "shift,walk")
    assert (done.status, [step for step, *_ in runs]) == (0, ["walk"])
    assert done.out.startswith("shift: skipped")


def test_each_step_is_confirmed(shell: Shell, runs: list[Run], monkeypatch: pytest.MonkeyPatch) -> None:
    answered = Mock(side_effect=["y", "Yes", ""])
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", answered)
    assert shell("bring-up", "stand", "--bus", "virtual", "--steps", "hold,legs,walk").status == 2
    assert [step for step, *_ in runs] == ["hold", "legs"]
    hangs = ["air" in asked.args[0] for asked in answered.call_args_list]
    assert hangs == [True, True, False]
