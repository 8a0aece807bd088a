"""`footfall demo`, `sweep` and `list`. Nothing is trained here: `demo` only starts other commands."""

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from recorder import Recorder
from shell import Shell

from footfall.cli import app
from footfall.train.sweeps.results import Point, Trial
from footfall.verbs import demo as demo_module


def test_the_demo_runs_from_training_to_a_report(shell: Shell, called: Recorder) -> None:
    called.replace("footfall.verbs.demo._step", 0)
    called.replace("footfall.policies.registry.zoo_names", ["go1-flat"])
    called.replace("footfall.policies.registry.walking_controllers", ["trot", "mpc"])
    options = "--out d --seed 7 --episodes 3 --preset smoke --scenarios push,gentle"
    outcome = shell("demo", *options.split())
    assert outcome.status == 0, outcome.err
    steps = [tokens for name, tokens, _ in called.calls if name == "_step"]
    shared = "--robot go1 --seed 7"
    assert [" ".join(tokens) for tokens in steps] == [
        f"train {shared} --no-evaluate --preset smoke --out d/trained",
        "export d/trained --out d/policy.onnx",
        f"deploy d/trained {shared} --command 0.5,0,0 --duration 10 --log d/walk.mcap --json d/walk.json",
        f"compare d/trained go1-flat trot mpc {shared} --scenarios push,gentle --episodes 3"
        " --json d/compare.json --html d/report.html",
    ]
    for step in steps:
        app.parse_args(list(step), exit_on_error=False, print_error=False)
    assert str(Path("d/report.html").resolve()) in outcome.out


def test_requirements_are_checked_before_the_first_step(shell: Shell, called: Recorder) -> None:
    called.replace("footfall.verbs.demo._step", 0)
    for option, complaint in (
        ("--scenarios gentle,ballet", "no scenario 'ballet'"), ("--preset huge", "no preset 'huge'"),
        ("--robot rex", "no robot 'rex'"),
    ):  # fmt: skip
        assert complaint in shell.refuses("demo", "--out", "d", *option.split())
    Path("file").touch()
    for not_empty in ("file", "."):
        assert "not empty" in shell.refuses("demo", "--out", not_empty)
    called.replace("footfall.evaluate.report.extra.find_spec", None)
    assert "an HTML report needs" in shell.refuses("demo", "--out", "d")
    assert "_step" not in called.names
    assert not Path("d").exists()


def test_a_falling_policy_is_compared(monkeypatch: pytest.MonkeyPatch, shell: Shell) -> None:
    """deploy and then the demo end with status 1 after a fall; of other steps that status ends the demo."""
    statuses = {"train": 0, "export": 0, "deploy": 1, "compare": 0}
    ran: list[str] = []

    def begin(command: list[str]) -> Any:
        verb = command[command.index("footfall") + 1]
        ran.append(verb)
        return SimpleNamespace(wait=lambda: statuses[verb])

    monkeypatch.setattr(demo_module.subprocess, "Popen", begin)
    assert shell("demo", "--out", "d").status == 1
    assert ran == ["train", "export", "deploy", "compare"]
    statuses["export"] = 1
    assert shell("demo", "--out", "d").status == 2
    assert ran[4:] == ["train", "export"]


@pytest.fixture
def swept(called: Recorder) -> SimpleNamespace:
    """The result of a sweep."""
    pytest.importorskip("ray", reason="needs Ray: install footfall[sweep]")
    settings = {"ppo.clip_param": 0.2, "ppo.epochs": 3}
    trial = Trial(folder="trial-0", settings=settings, seed=4, value=1.23456, steps=12345, error="")
    point = Point(settings=settings, mean=2.34567, spread=0.5, seeds=3, failed=0, unfinished=0)
    state = SimpleNamespace(trials=[trial], points=[point], unfinished=0)
    for name in ("sweep", "resume_sweep"):
        answer = lambda *_: (state.trials, state.points, state.unfinished)  # noqa: E731
        called.replace(f"footfall.train.sweeps.sweep.{name}", answer)
    return state


def test_a_sweep_begins_or_is_resumed(shell: Shell, called: Recorder, swept: SimpleNamespace) -> None:
    swept.points.append(swept.points[0]._replace(mean=2.5, spread=math.nan, seeds=1, failed=2, unfinished=4))
    outcome = shell("sweep", "space.yaml", "--out", "mine")
    assert outcome.status == 0
    assert called.of("sweep") == ((Path("space.yaml"), Path("mine")), {})
    rows = [line.split() for line in outcome.out.splitlines()]
    assert ["trial-0", "4", "0.2", "3", "1.235", "12,345"] in rows
    assert ["0.2", "3", "2.346", "±", "0.5", "3"] in rows
    assert ["0.2", "3", "2.5", "unknown", "1", "2", "4"] in rows
    assert shell("sweep", "--resume", "mine").status == 0
    assert called.of("resume_sweep") == ((Path("mine"),), {})
    assert "--out" in shell.refuses("sweep", "--resume", "mine", "--out", "x")
    assert "give either" in shell.refuses("sweep")
    assert "give either" in shell.refuses("sweep", "a.yaml", "--resume", "mine")


def test_failed_and_remaining_runs_set_the_exit_status(shell: Shell, swept: SimpleNamespace) -> None:
    swept.trials = [swept.trials[0], swept.trials[0]._replace(error="it broke")]
    for swept.unfinished, status, text in ((0, 1, "it broke"), (2, 130, "footfall sweep --resume mine")):
        outcome = shell("sweep", "space.yaml", "--out", "mine")
        assert outcome.status == status
        assert text in outcome.out


ROOT = Path(__file__).parents[2]


def test_everything_that_ships_is_there_with_its_facts(shell: Shell) -> None:
    outcome = shell("list", "--json")
    assert outcome.status == 0
    listed = {kind: {row["name"]: row for row in rows} for kind, rows in json.loads(outcome.out).items()}
    assert list(listed) == ["robots", "controllers", "policies", "scenarios", "presets"]
    assert set(listed["robots"]) == {path.parent.name for path in ROOT.glob("robots/*/robot.yaml")}
    assert set(listed["policies"]) == {path.parent.name for path in ROOT.glob("policies/zoo/*/policy.onnx")}
    assert set(listed["presets"]) == {path.stem for path in ROOT.glob("train/presets/*.yaml")}
    scenarios = yaml.safe_load((ROOT / "evaluate/scenarios.yaml").read_text())["scenarios"]
    assert set(listed["scenarios"]) == set(scenarios)
    hexapod = listed["robots"]["hexapod"]
    assert (hexapod["feet"], hexapod["joints"]) == (6, 18)
    assert hexapod["controllers"] == ["stand", "tripod", "ripple", "wave", "mpc"]
    assert hexapod["policies"] == ["hexapod-flat", "hexapod-getup", "hexapod-rough"]
    assert listed["robots"]["g1"]["policies"] == ["g1-flat", "g1-getup", "g1-rough"]
    assert listed["controllers"]["step"]["robots"] == ["g1"]
    assert [listed["controllers"][name]["walks"] for name in ("stand", "mpc")] == [False, True]
    assert listed["policies"]["g1-flat"]["robot"] == "g1"
    gentle, smoke = listed["scenarios"]["gentle"], listed["presets"]["smoke"]
    assert (gentle["episodes"], gentle["duration_s"], smoke["total_steps"]) == (24, 10.0, 4096)
    assert gentle["about"]
    assert smoke["about"]


def test_a_robot_folder_limits_the_list_to_its_controllers(own_folder: Path, shell: Shell) -> None:
    listed = json.loads(shell("list", "--robot", own_folder, "--json").out)
    (robot,) = listed["robots"]
    assert robot["controllers"]
    assert {row["name"] for row in listed["controllers"]} == set(robot["controllers"])
    assert all(row["robots"] == [robot["name"]] for row in listed["controllers"])
    assert {row["name"] for row in listed["policies"]} == set(robot["policies"])
    assert shell("list", "--robot", own_folder).status == 0
