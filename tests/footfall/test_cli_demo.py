"""`footfall demo`: which commands it runs, without running them."""

from pathlib import Path

import pytest
from shell import Shell

from footfall.cli import app
from footfall.common.errors import UserError
from footfall.verbs import demo as demo_module


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, ...]]:
    """The commands that the demo would run."""
    found: list[tuple[str, ...]] = []
    monkeypatch.setattr(demo_module, "_step", lambda *tokens, **_: found.append(tokens))
    return found


def test_it_goes_from_training_to_a_report(
    steps: list[tuple[str, ...]], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    outcome = Shell(capsys)("demo", "--out", tmp_path / "demo", "--seed", "7", "--episodes", "3")
    assert outcome.status == 0
    assert [step[0] for step in steps] == ["train", "export", "deploy", "compare"]
    for step in steps:
        app.parse_args(list(step), exit_on_error=False, print_error=False)
    train, _, deploy, compare = steps
    run = str(tmp_path / "demo" / "trained")
    assert train[-1] == run
    assert deploy[1] == compare[1] == run
    assert {"trot", "mpc"} <= set(compare)
    assert all("7" in step for step in (train, deploy, compare))
    assert str((tmp_path / "demo" / "report.html").resolve()) in outcome.out


@pytest.mark.parametrize(
    ("robot", "walkers", "half_speed"),
    [("hexapod", ["hexapod-flat", "tripod"], "0.125"), ("g1", ["g1-flat", "step"], "0.4")],
)
def test_another_robot_is_asked_for_its_own_controllers_of_each_kind_and_speed(
    steps: list[tuple[str, ...]],
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    robot: str,
    walkers: list[str],
    half_speed: str,
) -> None:
    Shell(capsys)("demo", "--robot", robot, "--out", tmp_path / "demo")
    _, _, deploy, compare = steps
    assert list(compare[2 : compare.index("--robot")]) == walkers
    assert deploy[deploy.index("--command") + 1] == f"{half_speed},0,0"


def test_what_the_last_step_needs_is_known_before_the_first(
    steps: list[tuple[str, ...]], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    shell = Shell(capsys)
    assert "no scenario 'ballet'" in shell.refuses("demo", "--scenarios", "ballet")
    monkeypatch.setattr("footfall.evaluate.report.extra.find_spec", lambda _: None)
    assert "an HTML report needs" in shell.refuses("demo")
    assert steps == []


def test_a_preset_that_does_not_exist_is_refused_before_anything_is_made(
    steps: list[tuple[str, ...]], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert "no preset 'huge'" in Shell(capsys).refuses("demo", "--preset", "huge", "--out", tmp_path / "demo")
    assert not (tmp_path / "demo").exists()
    assert steps == []


def test_a_failed_step_ends_it() -> None:
    with pytest.raises(UserError, match="footfall train failed with status 2"):
        demo_module._step("train", "--preset", "huge")


def test_a_policy_that_falls_over_the_bus_is_still_compared(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """deploy ends with status 1 after a fall; of every other step that status ends the demo."""
    statuses = {"train": 0, "export": 0, "deploy": 1, "compare": 0}
    ran: list[str] = []

    class Step:
        def __init__(self, command: list[str]) -> None:
            self.verb = command[command.index("footfall") + 1]
            ran.append(self.verb)

        def wait(self) -> int:
            return statuses[self.verb]

    monkeypatch.setattr(demo_module.subprocess, "Popen", Step)
    assert Shell(capsys)("demo", "--out", tmp_path / "demo").status == 0
    assert ran == ["train", "export", "deploy", "compare"]
    statuses["export"] = 1
    assert Shell(capsys)("demo", "--out", tmp_path / "demo").status == 2
    assert ran[4:] == ["train", "export"]
