"""`footfall deploy` and `footfall bring-up`: options, questions, exit status, figures and files."""

import json
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from edited import edit
from quick_relaxed import write_quick
from recorder import Recorder
from shell import Shell
from tiny_policy import write_policy
from walking_run import WALKING

from footfall.deploy.bring_up.steps import STEPS, Setting, Step, Verdict
from footfall.deploy.config import DeployConfig
from footfall.deploy.recovery import Recovered
from footfall.deploy.session import SessionResult
from footfall.robots.description import Robot
from footfall.verbs import bring_up

SHORT = ("--duration", "0.6")


def test_a_users_robot_and_policy_are_deployed(shell: Shell, own_folder: Path, tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx")
    edit(own_folder, "robot.yaml", "name: go1", "name: mine")
    walk = write_policy(onnx, tmp_path / "walk.onnx", own_folder)
    assert shell("deploy", walk, "--robot", own_folder, *SHORT, "--config", write_quick(tmp_path)).status == 0
    assert "mine" in shell.refuses("deploy", walk, *SHORT)


TIMING = {
    "tick_us_p99": 2.0, "policy_ms_p99": 4.0, "lateness_us_max": 9.0, "overruns": 7.0, "ticks": 800.0,
    "tick_us_p50": 1.0, "policy_ms_p50": 0.25, "lateness_us_p50": 5.0, "lateness_us_p99": 6.0,
    "ticks_skipped": 11.0,
}  # fmt: skip


def run_result(**changes: Any) -> Any:
    """The result of a run with late ticks that ended safely."""
    fields = {
        "walked_s": 1.5, "final_state": "IDLE", "faults": (), "notes": ("a note",), "buses": (),
        "wall_s": 2.0, "run_s": 3.0, "fell": False, "fall_reason": "", "distance_m": 0.7,
        "mean_velocity": np.array([0.4, -0.1, 0.2]), "timing": TIMING, "recoveries": (),
    }  # fmt: skip
    return SimpleNamespace(**(fields | changes))


class TestOptions:
    OPTIONS = "--command -100,99.5,100 --duration 1.25 --seed 9 --log a.mcap --json a.json --config a.yaml"

    def test_scans_that_no_policy_reads_are_refused(
        self, shell: Shell, called: Recorder, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """Otherwise a user believes that the policy sees the ground."""
        monkeypatch.setenv("FOOTFALL_TOKEN", "a token of the tests, shared")
        called.replace("footfall.plant.episode.run_episode", run_result())
        free_port = ("--height-scan", "udp:127.0.0.1:0")
        assert "udp:127.0.0.1:0" in shell.refuses("deploy", "go1-flat", *free_port)
        assert shell("deploy", "go1-flat", "--also", "go1-rough", *free_port).status == 0
        assert shell("deploy", "go1-flat", "--height-scan", "off").status == 0

    def test_options_reach_the_simulation(self, shell: Shell, called: Recorder, go1: Robot) -> None:
        Path("a.yaml").write_text("joint_rate_hz: 1000.0")
        called.replace("footfall.plant.episode.run_episode", run_result())
        more = ("--plant", str(go1.xml_path), "--ground-truth", "--realtime")
        outcome = shell("deploy", "trot", *self.OPTIONS.split(), *more)
        assert outcome.status == 0, outcome.err
        (robot, policy, episode), _ = called.of("run_episode")
        assert (robot.name, policy.name) == ("go1", "trot")
        assert episode.command_source.poll(WALKING).velocity.tolist() == [-100.0, 99.5, 100.0]
        assert (episode.duration_s, episode.seed, episode.plant) == (1.25, 9, go1.xml_path)
        assert (episode.ground_truth, episode.realtime, episode.record) == (True, True, False)
        assert (episode.log, episode.policy_spec) == (Path("a.mcap"), "trot")
        assert episode.config == DeployConfig(joint_rate_hz=1000.0)
        assert (episode.noise, episode.pushes, episode.sample) == (None, (), None)
        result = json.loads(Path("a.json").read_text())
        assert result["settings"]["gait"]["name"] == "trot"
        assert result.items() >= {
            "policy": "trot", "robot": "go1", "bus": "sim", "seed": 9, "duration_s": 1.25, "walked_s": 1.5,
            "final_state": "IDLE", "fell": False, "distance_m": 0.7,
        }.items()  # fmt: skip
        assert (result["timing"], result["mean_velocity_m_s"]) == (TIMING, [0.4, -0.1, 0.2])
        assert "a note" in outcome.out

    def test_recover_needs_a_get_up_policy(self, shell: Shell, called: Recorder) -> None:
        recovery = Recovered("tilt", 1.0, 3.5, 2)
        called.replace("footfall.plant.episode.run_episode", run_result(recoveries=(recovery,)))
        assert shell("deploy", "trot", "--recover", "--get-up", "stand", "--json", "a.json").status == 0
        (_, _, episode), _ = called.of("run_episode")
        assert (episode.get_up.policy.name, episode.get_up.spec) == ("stand", "stand")
        assert json.loads(Path("a.json").read_text())["recoveries"] == [recovery._asdict()]
        assert "--recover" in shell.refuses("deploy", "trot", "--get-up", "stand")
        called.replace("footfall.policies.registry.zoo_names", [])
        assert "--get-up" in shell.refuses("deploy", "trot", "--recover")

    def test_options_set_how_a_simulated_robot_begins_and_ends(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.plant.episode.run_episode", run_result())
        for options, lying, lie_down in (
            ("", False, True), ("--start lying", True, True), ("--no-lie-down", False, False)
        ):  # fmt: skip
            called.calls.clear()
            assert shell("deploy", "tripod", "--robot", "hexapod", *options.split()).status == 0
            (robot, policy, episode), _ = called.of("run_episode")
            assert (robot.name, policy.name) == ("hexapod", "tripod")
            assert (episode.lying, episode.lie_down) == (lying, lie_down)
        assert (episode.plant, episode.ground_truth, episode.realtime) == (None, False, False)
        assert episode.command_source.poll(WALKING).velocity.tolist() == [0.5, 0.0, 0.0]
        assert episode.duration_s == 10.0

    def test_status_0_means_a_safe_end(self, shell: Shell, called: Recorder) -> None:
        fell = {"fell": True, "fall_reason": "it tilted"}
        for outcome, status in (({}, 0), ({"final_state": "ESTOP"}, 1), (fell, 1)):
            called.replace("footfall.plant.episode.run_episode", run_result(faults=("motor 3",), **outcome))
            shown = shell("deploy", "stand")
            assert shown.status == status
            assert "motor 3" in shown.out

    @pytest.mark.parametrize("bus", ["socketcan", "virtual"])
    def test_options_reach_a_can_interface(self, shell: Shell, called: Recorder, bus: str) -> None:
        called.replace("footfall.plant.serve.serving", nullcontext())
        ended = run_result(final_state="FALLING", faults=("tilt", "x"))
        called.replace("footfall.deploy.session.run_on_interface", ended)
        Path("a.yaml").write_text("stand_s: 2.5")
        assert shell("deploy", "stand", "--bus", bus, *self.OPTIONS.split()).status == 1
        (robot, policy, where, session), _ = called.of("run_on_interface")
        assert (robot.name, policy.name, where) == ("go1", "stand", bus)
        assert session.command_source.poll(WALKING).velocity.tolist() == [-100.0, 99.5, 100.0]
        assert (session.duration_s, session.log, session.lie_down) == (1.25, Path("a.mcap"), True)
        assert session.facts == {"seed": 9, "policy_spec": "stand", "bus": bus, "plant": None}
        assert session.config == DeployConfig(stand_s=2.5, odometry=True)  # for the log
        assert ("serving" in called.names) is (bus == "virtual")
        figures = json.loads(Path("a.json").read_text())
        assert (figures["bus"], figures["fell"], figures["fall_reason"]) == (bus, True, "tilt")
        assert (figures["distance_m"], figures["mean_velocity_m_s"]) == (None, [None] * 3)
        called.calls.clear()
        shell("deploy", "stand", "--bus", bus, "--no-lie-down")
        assert called.of("run_on_interface")[0][3].lie_down is False


Run = tuple[str, Setting, str]


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[Run]:
    """Each step that was run, its setting and its bus; `stand` fails below half of the torque."""
    given: list[Run] = []

    def run_step(step: Step, setting: Setting, bus: str) -> Verdict:
        given.append((step.name, setting, bus))
        fails = step.name == "stand" and setting.deploy.scale < 0.5
        result = SessionResult("IDLE", (), 1.0, 2.5, 3.0, np.zeros(1), {}, (), ("a note",), (), "")
        return Verdict(step.name, ("the robot is tilted", "a foot hangs") if fails else (), result)

    monkeypatch.setattr(bring_up, "_run_step", run_step)
    return given


def test_the_default_is_all_steps_of_go1_in_simulation(shell: Shell, runs: list[Run]) -> None:
    done = shell("bring-up", "stand", "--json", "a.json")
    assert (done.status, done.err) == (0, "")
    assert done.out.splitlines() == [f"{step.name}: {step.about}: passed" for step in STEPS]
    assert [(step, bus) for step, _, bus in runs] == [(step.name, "sim") for step in STEPS]
    setting = runs[0][1]
    assert (setting.robot.name, setting.policy.name, setting.realtime) == ("go1", "stand", False)
    written = json.loads(Path("a.json").read_text())
    assert written.items() >= {"robot": "go1", "bus": "sim", "scale": 0.5}.items()
    skipped = ("--robot", "g1", "--steps", "shift", "--json", "b.json")
    assert (shell("bring-up", "step", *skipped).status, Path("b.json").exists()) == (0, True)


def test_robot_policy_bus_and_loop_can_be_chosen(shell: Shell, runs: list[Run]) -> None:
    Path("loop.yaml").write_text("stand_s: 2.5")
    options = ("--robot", "hexapod", "--bus", "slcan", "--yes", "--config", "loop.yaml", "--json", "a.json")
    assert shell("bring-up", "tripod", "--steps", "walk", "--scale", "0.7", *options).status == 0
    ((step, setting, bus),) = runs
    assert (step, bus, setting.realtime) == ("walk", "slcan", True)
    assert (setting.robot.name, setting.policy.name) == ("hexapod", "tripod")
    assert (setting.deploy.stand_s, setting.deploy.scale) == (2.5, 0.7)
    written = json.loads(Path("a.json").read_text())
    assert written.items() >= {"robot": "hexapod", "bus": "slcan", "scale": 0.7}.items()


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
    results = json.loads(Path("a.json").read_text())["steps"]
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
    answered = Mock(side_effect=["y", "Yes", "", ""])
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", answered)
    assert shell("bring-up", "stand", "--bus", "virtual", "--steps", "hold,legs,walk").status == 2
    assert [step for step, *_ in runs] == ["hold", "legs"]
    hangs = ["air" in asked.args[0] for asked in answered.call_args_list]
    assert hangs == [True, True, False]
    Path("a.json").write_text("of an earlier run")
    assert shell("bring-up", "stand", "--bus", "virtual", "--json", "a.json").status == 2
    assert Path("a.json").read_text() == "of an earlier run"
