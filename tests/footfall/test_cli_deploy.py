"""`footfall deploy` and `footfall replay`: exit status, figures and files."""

import json
import re
import shutil
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from shell import Shell
from tiny_policy import write_policy

from footfall.cli import main
from footfall.common.errors import UserError
from footfall.deploy.session import Session
from footfall.plant import episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.policy import Policy
from footfall.policies.registry import ZOO
from footfall.robots.description import ROBOTS, Robot

SHORT = ("--duration", "0.6")


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str]) -> Shell:
    return Shell(capsys)


class Made(NamedTuple):
    """What a deployment has left."""

    log: Path
    figures: dict[str, Any]


def made(folder: Path, *tokens: str) -> Made:
    log, figures = folder / "run.mcap", folder / "run.json"
    assert main(["deploy", *tokens, *SHORT, "--log", str(log), "--json", str(figures)]) == 0
    return Made(log, json.loads(figures.read_text()))


@pytest.fixture(scope="module")
def stood(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """By a robot that stood for a moment."""
    return made(tmp_path_factory.mktemp("stood"), "stand", "--command", "0,0,0", "--seed", "3")


@pytest.fixture(scope="module")
def trotted(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """By a robot that trotted for a moment."""
    return made(tmp_path_factory.mktemp("trotted"), "trot", "--seed", "5")


def test_a_safe_run_writes_its_figures(stood: Made) -> None:
    figures = stood.figures
    assert figures["final_state"] == "IDLE"
    assert figures["faults"] == []
    assert figures["fell"] is False
    assert figures["command"] == [0.0, 0.0, 0.0]
    assert figures["seed"] == 3
    assert figures["walked_s"] == pytest.approx(0.6, abs=0.02)
    assert 0.0 <= figures["distance_m"] < 0.05
    assert figures["timing"]["tick_us_p99"] > 0
    assert [bus["name"] for bus in figures["buses"]] == ["can0", "can1", "can2", "can3"]


def test_walking_covers_the_ground_that_was_asked_for(shell: Shell, tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    assert shell("deploy", "trot", "--command", "0.3,0,0", "--duration", "2.5", "--json", path).status == 0
    figures = json.loads(path.read_text())
    assert figures["distance_m"] == pytest.approx(0.75, rel=0.4)
    assert figures["mean_velocity_m_s"][0] == pytest.approx(figures["distance_m"] / 2.5, rel=0.2)


def test_a_silent_motor_is_an_emergency_stop_with_status_1(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class WithASilentMotor(SimulatedRobot):
        def advance(self, now_us: int) -> None:
            self.faults.motors.silent[5] = now_us > 1_550_000  # half a second into the walk
            super().advance(now_us)

    monkeypatch.setattr(episode, "SimulatedRobot", WithASilentMotor)
    path = tmp_path / "run.json"
    outcome = shell("deploy", "stand", "--duration", "3", "--json", path)
    assert outcome.status == 1
    assert "no reply from FL_calf_joint" in " ".join(outcome.out.split())
    figures = json.loads(path.read_text())
    assert figures["final_state"] == "ESTOP"
    assert figures["fell"] is False
    assert figures["walked_s"] == pytest.approx(0.55, abs=0.02)


def test_a_robot_that_tips_over_has_fallen_with_status_1(shell: Shell, tmp_path: Path) -> None:
    settings = tmp_path / "loop.yaml"
    settings.write_text("safety: {tilt_limit_rad: 1.0e-6}")
    path = tmp_path / "run.json"
    outcome = shell("deploy", "stand", *SHORT, "--config", settings, "--json", path)
    assert outcome.status == 1
    assert "tilt" in outcome.out
    figures = json.loads(path.read_text())
    assert figures["final_state"] == "FALLING"
    assert figures["fell"] is True
    assert figures["faults"]


def test_a_walk_too_short_to_measure_has_no_nan_in_it(shell: Shell) -> None:
    outcome = shell("deploy", "stand", "--duration", "0.001")
    assert outcome.status == 0
    assert "nan" not in outcome.out


def test_a_command_beyond_the_training_is_clipped_with_a_note(shell: Shell, tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    outcome = shell("deploy", "go1-flat", *SHORT, "--command", "5,0,0", "--json", path)
    assert outcome.status == 0
    (note,) = json.loads(path.read_text())["notes"]
    assert note == "the policy was trained on forward commands from -1.2 to 1.8 m/s: 5 became 1.8"
    assert note in " ".join(outcome.out.split())


def test_a_torn_log_is_recovered_under_another_name(shell: Shell, stood: Made, tmp_path: Path) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(stood.log.read_bytes()[:-2000])
    outcome = shell("log", "recover", torn)
    assert outcome.status == 0, outcome.err
    whole = tmp_path / "torn.recovered.mcap"
    assert str(whole) in "".join(outcome.out.split())
    assert "the same decisions" in shell("replay", whole).out
    assert "give another file" in shell.refuses("log", "recover", torn, "--out", torn)


def test_the_same_seed_gives_the_same_run(trotted: Made, tmp_path: Path) -> None:
    again = made(tmp_path, "trot", "--seed", "5").figures
    for name in ("distance_m", "mean_velocity_m_s", "buses"):
        assert again[name] == trotted.figures[name]


@pytest.mark.parametrize(("told", "lies_down"), [((), True), (("--no-lie-down",), False)])
def test_a_robot_on_a_real_bus_lies_down_unless_told_not_to(
    shell: Shell, monkeypatch: pytest.MonkeyPatch, told: tuple[str, ...], lies_down: bool
) -> None:
    sessions: list[Session] = []

    def refused(_: Robot, __: Policy, bus: str, session: Session) -> None:
        sessions.append(session)
        raise UserError(f"no bus {bus} here")

    monkeypatch.setattr("footfall.deploy.session.run_on_interface", refused)
    assert shell.refuses("deploy", "stand", "--bus", "socketcan", *told) == "no bus socketcan here"
    assert sessions[0].lie_down is lies_down


def test_json_to_standard_output(shell: Shell) -> None:
    """A device is written to, not replaced by a file of its name."""
    outcome = shell("deploy", "stand", "--duration", "0.1", "--json", "/dev/null")
    assert (outcome.status, outcome.err) == (0, "")
    assert "IDLE" in outcome.out
    assert not Path("/dev/null").is_file()


def test_a_users_own_robot_and_policy(shell: Shell, own_folder: Path, tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx")
    declaration = own_folder / "robot.yaml"
    declaration.write_text(declaration.read_text().replace("name: go1", "name: mine"))
    walk = write_policy(onnx, tmp_path / "walk.onnx", own_folder)
    assert shell("deploy", walk, "--robot", own_folder, *SHORT).status == 0
    assert "robot: policy has mine, robot has go1" in shell.refuses("deploy", walk, *SHORT)
    assert own_folder != ROBOTS / "go1"


def test_a_log_replays_to_the_same_decisions(shell: Shell, trotted: Made) -> None:
    outcome = shell("replay", trotted.log)
    assert outcome.status == 0, outcome.out
    assert "the same decisions" in outcome.out


def test_a_log_replays_with_the_settings_that_made_it(shell: Shell, tmp_path: Path) -> None:
    """Also when the file that they came from has changed."""
    log, figures, mine = tmp_path / "run.mcap", tmp_path / "run.json", tmp_path / "mine.yaml"
    mine.write_text("kp: 45.0")
    spec = f"stand@{mine}"
    assert shell("deploy", spec, "--set", "stand.kd=2.5", *SHORT, "--log", log, "--json", figures).status == 0
    told = json.loads(figures.read_text())
    assert told["policy"] == f"{spec}@kd=2.5"
    assert (told["settings"]["kp"], told["settings"]["kd"], told["settings"]["tilt_gain"]) == (45.0, 2.5, 0.3)
    mine.write_text("kp: 300.0")
    assert shell("replay", log).status == 0
    assert shell("replay", log, "--policy", spec).status == 1
    assert shell("replay", log, "--policy", "stand@kp=45@kd=2.5").status == 0


def test_a_log_finds_a_users_own_robot_unless_that_has_changed(
    shell: Shell, own_folder: Path, tmp_path: Path
) -> None:
    log = tmp_path / "run.mcap"
    declaration = own_folder / "robot.yaml"
    for name in ("go1", "mine"):  # the first is also a robot of ours
        declaration.write_text(declaration.read_text().replace("name: go1", f"name: {name}"))
        assert shell("deploy", "stand", "--robot", own_folder, *SHORT, "--log", log).status == 0
        assert shell("replay", log).status == 0
    height = re.compile("^standing_height_m: .*", re.MULTILINE)
    declaration.write_text(height.sub("standing_height_m: 0.29", declaration.read_text()))
    assert "give --robot" in shell.refuses("replay", log)
    assert shell("replay", log, "--robot", own_folder).status == 0


def test_another_policy_differs_and_says_where(shell: Shell, trotted: Made) -> None:
    outcome = shell("replay", trotted.log, "--policy", "stand")
    assert outcome.status == 1
    assert "first difference: step " in outcome.out
    assert "_joint" in outcome.out
    assert shell("replay", trotted.log, "--policy", "stand", "--tolerance", "100").status == 0


def test_a_log_whose_policy_is_gone_asks_for_one(shell: Shell, tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx")
    walk = write_policy(onnx, tmp_path / "walk.onnx", ROBOTS / "go1")
    log = tmp_path / "run.mcap"
    assert shell("deploy", walk, *SHORT, "--log", log).status == 0
    walk.rename(tmp_path / "moved.onnx")
    assert "--policy" in shell.refuses("replay", log)
    assert shell("replay", log, "--policy", tmp_path / "moved.onnx").status == 0


def test_a_log_replays_with_the_policy_file_that_made_it(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(ZOO / "go1-flat" / "policy.onnx", tmp_path / "mine.onnx")
    monkeypatch.chdir(tmp_path)
    assert shell("deploy", "mine.onnx", "--duration", "0.5", "--log", "walk.mcap").status == 0
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    outcome = shell("replay", tmp_path / "walk.mcap")
    assert outcome.status == 0, outcome.err
    assert "the same decisions" in outcome.out
