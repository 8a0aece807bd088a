"""`footfall replay`: choice of policy and robot, exit status, output."""

import json
from pathlib import Path

import pytest
from edited import edit
from quick_relaxed import write_quick
from shell import Shell
from tiny_policy import write_policy

from footfall.robots.description import ROBOTS


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, ...]:
    """Options of a brief run that stands up and lies down quickly."""
    return "--duration", "0.3", "--config", write_quick(tmp_path_factory.mktemp("quick"))


def test_a_log_replays_with_its_settings(shell: Shell, short: tuple[str, ...], tmp_path: Path) -> None:
    """The log's settings count even if the settings' file has changed."""
    mine, files = tmp_path / "mine.yaml", ("--log", "run.mcap", "--json", "run.json")
    mine.write_text("kp: 45.0")
    spec = f"stand@{mine}"
    assert shell("deploy", spec, "--set", "stand.kd=2.5", *short, *files).status == 0
    output = json.loads(Path("run.json").read_text())
    assert output["policy"] == f"{spec}@kd=2.5"
    assert output["settings"].items() >= {"kp": 45.0, "kd": 2.5, "tilt_gain": 0.3}.items()
    mine.write_text("kp: 300.0")
    assert shell("replay", "run.mcap").status == 0
    assert shell("replay", "run.mcap", "--policy", spec).status == 1
    assert shell("replay", "run.mcap", "--policy", "stand@kp=45@kd=2.5").status == 0


def test_a_users_robot_is_found(shell: Shell, short: tuple[str, ...], own_folder: Path) -> None:
    log = "run.mcap"
    edit(own_folder, "robot.yaml", "name: go1", "name: mine")
    assert shell("deploy", "stand", "--robot", own_folder, *short, "--log", log).status == 0
    assert shell("replay", log).status == 0
    edit(own_folder, "robot.yaml", "standing_height_m: 0.2945", "standing_height_m: 0.29")
    assert "give --robot" in shell.refuses("replay", log)
    assert shell("replay", log, "--robot", own_folder).status == 0


def test_the_same_policy_decides_the_same_and_another_differs(shell: Shell, short: tuple[str, ...]) -> None:
    assert shell("deploy", "trot", "--seed", "5", *short, "--log", "run.mcap").status == 0
    outcome = shell("replay", "run.mcap")
    assert outcome.status == 0, outcome.out
    assert "the same decisions" in outcome.out
    outcome = shell("replay", "run.mcap", "--policy", "stand")
    assert outcome.status == 1
    assert "first difference: step " in outcome.out
    assert "_joint" in outcome.out
    assert shell("replay", "run.mcap", "--policy", "stand", "--tolerance", "100").status == 0


def test_a_log_whose_policy_is_missing_needs_the_option(shell: Shell, short: tuple[str, ...]) -> None:
    walk = write_policy(pytest.importorskip("onnx"), Path("walk.onnx"), ROBOTS / "go1")
    assert shell("deploy", walk, *short, "--log", "run.mcap").status == 0
    walk.rename("moved.onnx")
    assert "--policy" in shell.refuses("replay", "run.mcap")
    assert shell("replay", "run.mcap", "--policy", "moved.onnx").status == 0
