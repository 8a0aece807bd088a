"""`footfall demo`: which commands it runs, without running them."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from recorder import Recorder
from shell import Shell

from footfall.cli import app
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
        ("--scenarios gentle,ballet", "no scenario 'ballet'"),
        ("--preset huge", "no preset 'huge'"),
        ("--robot rex", "no robot 'rex'"),
    ):
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
