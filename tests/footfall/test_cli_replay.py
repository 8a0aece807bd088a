"""`footfall replay`: choice of policy and robot, exit status, output."""

import json
from pathlib import Path

import pytest
from edited import edit
from quick_relaxed import write_quick
from shell import Shell
from tiny_policy import write_policy

from footfall.cli import main
from footfall.robots.description import ROBOTS


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, ...]:
    """Options of a brief run that stands up and lies down quickly."""
    return "--duration", "0.3", "--config", write_quick(tmp_path_factory.mktemp("quick"))


@pytest.fixture(scope="module")
def trotted(short: tuple[str, ...], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of a robot that trotted for a moment."""
    log = tmp_path_factory.mktemp("trotted") / "run.mcap"
    assert main(["deploy", "trot", "--seed", "5", *short, "--log", str(log)]) == 0
    return log


def test_a_log_replays_to_the_same_decisions(shell: Shell, trotted: Path) -> None:
    outcome = shell("replay", trotted)
    assert outcome.status == 0, outcome.out
    assert "the same decisions" in outcome.out


def test_a_log_replays_with_its_settings(shell: Shell, short: tuple[str, ...], tmp_path: Path) -> None:
    """The log's settings count even if the settings' file has changed."""
    log, figures, mine = tmp_path / "run.mcap", tmp_path / "run.json", tmp_path / "mine.yaml"
    mine.write_text("kp: 45.0")
    spec = f"stand@{mine}"
    assert shell("deploy", spec, "--set", "stand.kd=2.5", *short, "--log", log, "--json", figures).status == 0
    output = json.loads(figures.read_text())
    assert output["policy"] == f"{spec}@kd=2.5"
    assert (output["settings"]["kp"], output["settings"]["kd"], output["settings"]["tilt_gain"]) == (
        45.0,
        2.5,
        0.3,
    )
    mine.write_text("kp: 300.0")
    assert shell("replay", log).status == 0
    assert shell("replay", log, "--policy", spec).status == 1
    assert shell("replay", log, "--policy", "stand@kp=45@kd=2.5").status == 0


def test_a_users_robot_is_found(
    shell: Shell, short: tuple[str, ...], own_folder: Path, tmp_path: Path
) -> None:
    log = tmp_path / "run.mcap"
    edit(own_folder, "robot.yaml", "name: go1", "name: mine")
    assert shell("deploy", "stand", "--robot", own_folder, *short, "--log", log).status == 0
    assert shell("replay", log).status == 0
    edit(own_folder, "robot.yaml", "standing_height_m: 0.2945", "standing_height_m: 0.29")
    assert "give --robot" in shell.refuses("replay", log)
    assert shell("replay", log, "--robot", own_folder).status == 0


def test_another_policy_differs_and_the_time_is_reported(shell: Shell, trotted: Path) -> None:
    outcome = shell("replay", trotted, "--policy", "stand")
    assert outcome.status == 1
    assert "first difference: step " in outcome.out
    assert "_joint" in outcome.out
    assert shell("replay", trotted, "--policy", "stand", "--tolerance", "100").status == 0


def test_a_log_whose_policy_is_missing_is_refused_with_the_option(
    shell: Shell, short: tuple[str, ...], tmp_path: Path
) -> None:
    onnx = pytest.importorskip("onnx")
    walk = write_policy(onnx, tmp_path / "walk.onnx", ROBOTS / "go1")
    log = tmp_path / "run.mcap"
    assert shell("deploy", walk, *short, "--log", log).status == 0
    walk.rename(tmp_path / "moved.onnx")
    assert "--policy" in shell.refuses("replay", log)
    assert shell("replay", log, "--policy", tmp_path / "moved.onnx").status == 0
