"""Arguments and resources that `footfall bring-up` passes to its steps. No step is run."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from shell import Shell

from footfall.deploy.bring_up.steps import STEPS, Setting, Step, Verdict
from footfall.verbs import bring_up

OUTCOME: Any = SimpleNamespace(final_state="IDLE", run_s=2.5, notes=("a note",))


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Step, Setting, str]]:
    """Each step that was run, its setting and its bus; all pass."""
    given: list[tuple[Step, Setting, str]] = []

    def run_step(step: Step, setting: Setting, bus: str) -> Verdict:
        given.append((step, setting, bus))
        return Verdict(step.name, (), OUTCOME)

    monkeypatch.setattr(bring_up, "_run_step", run_step)
    return given


def test_the_default_is_all_steps_of_go1_in_simulation(shell: Shell, runs: list[Any], tmp_path: Path) -> None:
    done = shell("bring-up", "stand", "--json", "a.json")
    assert (done.status, done.err) == (0, "")
    assert done.out.splitlines() == [f"{step.name}: {step.about}: passed" for step in STEPS]
    assert [(step, bus) for step, _, bus in runs] == [(step, "sim") for step in STEPS]
    setting = runs[0][1]
    assert (setting.robot.name, setting.policy.name, setting.realtime) == ("go1", "stand", False)
    written = json.loads((tmp_path / "a.json").read_text())
    assert (written["robot"], written["bus"], written["scale"]) == ("go1", "sim", 0.5)
    assert [step["step"] for step in written["steps"]] == [step.name for step in STEPS]


def test_robot_policy_bus_and_loop_can_be_chosen(shell: Shell, runs: list[Any], tmp_path: Path) -> None:
    (tmp_path / "loop.yaml").write_text("stand_s: 2.5")
    options = ("--robot", "hexapod", "--bus", "slcan", "--yes", "--config", "loop.yaml", "--json", "a.json")
    assert shell("bring-up", "tripod", "--steps", "walk", "--scale", "0.7", *options).status == 0
    ((step, setting, bus),) = runs
    assert (step.name, bus, setting.realtime) == ("walk", "slcan", True)
    assert (setting.robot.name, setting.policy.name) == ("hexapod", "tripod")
    assert (setting.deploy.stand_s, setting.deploy.scale) == (2.5, 0.7)
    written = json.loads((tmp_path / "a.json").read_text())
    assert (written["robot"], written["bus"], written["scale"]) == ("hexapod", "slcan", 0.7)


@pytest.mark.parametrize(
    ("scale", "refused"), [("0.01", False), ("1", False), ("0.009", True), ("1.01", True)]
)
def test_the_scale_of_gains_and_torque_reaches_the_steps(
    shell: Shell, runs: list[Any], scale: str, refused: bool
) -> None:
    outcome = shell("bring-up", "stand", "--steps", "hold", "--scale", scale)
    assert outcome.status == (2 if refused else 0)
    assert ("--scale" in outcome.err) is refused
