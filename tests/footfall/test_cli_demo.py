"""`footfall demo`: which commands it runs, without running them."""

from pathlib import Path

import pytest
from recorder import Recorder
from shell import Shell

from footfall.cli import app
from footfall.verbs import demo as demo_module


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """The commands that the demo would run."""
    found: list[tuple[str, ...]] = []
    monkeypatch.setattr(demo_module, "_step", lambda *tokens, **_: found.append(tokens) or 0)
    return found


def test_the_demo_runs_from_training_to_a_report(
    steps: list[tuple[str, ...]], shell: Shell, called: Recorder
) -> None:
    called.replace("footfall.policies.registry.zoo_names", ["go1-flat"])
    called.replace("footfall.policies.registry.walking_controllers", ["trot", "mpc"])
    options = "--out d --seed 7 --episodes 3 --preset smoke --scenarios push,gentle"
    outcome = shell("demo", *options.split())
    assert outcome.status == 0, outcome.err
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


def test_requirements_of_all_steps_are_checked_before_the_first(
    steps: list[tuple[str, ...]], shell: Shell, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for option, complaint in (
        (("--scenarios", "gentle,ballet"), "no scenario 'ballet'"),
        (("--preset", "huge"), "no preset 'huge'"),
        (("--robot", "rex"), "no robot 'rex'"),
    ):
        assert complaint in shell.refuses("demo", "--out", "d", *option)
    (tmp_path / "file").touch()
    for not_empty in ("file", tmp_path):
        assert "not empty" in shell.refuses("demo", "--out", not_empty)
    monkeypatch.setattr("footfall.evaluate.report.extra.find_spec", lambda _: None)
    assert "an HTML report needs" in shell.refuses("demo", "--out", "d")
    assert steps == []
    assert not (tmp_path / "d").exists()


def test_a_falling_policy_is_compared(monkeypatch: pytest.MonkeyPatch, shell: Shell, tmp_path: Path) -> None:
    """deploy and then the demo end with status 1 after a fall; of other steps that status ends the demo."""
    statuses = {"train": 0, "export": 0, "deploy": 1, "compare": 0}
    ran: list[str] = []

    class Step:
        def __init__(self, command: list[str]) -> None:
            self.verb = command[command.index("footfall") + 1]
            ran.append(self.verb)

        def wait(self) -> int:
            return statuses[self.verb]

    monkeypatch.setattr(demo_module.subprocess, "Popen", Step)
    assert shell("demo", "--out", tmp_path / "demo").status == 1
    assert ran == ["train", "export", "deploy", "compare"]
    statuses["export"] = 1
    assert shell("demo", "--out", tmp_path / "demo").status == 2
    assert ran[4:] == ["train", "export"]
