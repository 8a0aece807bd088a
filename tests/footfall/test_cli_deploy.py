"""`footfall deploy`: options, exit status, figures and files."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from quick_relaxed import written
from recorder import Recorder
from shell import Shell
from tiny_policy import write_policy
from walking_run import WALKING

from footfall.cli import main
from footfall.deploy.config import DeployConfig
from footfall.deploy.log_file import read_log
from footfall.deploy.recovery import Recovered
from footfall.plant import episode
from footfall.plant.robot import SimulatedRobot
from footfall.robots.description import ROBOTS, Robot

SHORT = ("--duration", "0.6")


class Made(NamedTuple):
    """Files that a deployment wrote."""

    log: Path
    figures: dict[str, Any]


def made(folder: Path, *tokens: str) -> Made:
    quick = ("--config", written(folder))
    log, figures = folder / "run.mcap", folder / "run.json"
    assert main(["deploy", *tokens, *SHORT, *quick, "--log", str(log), "--json", str(figures)]) == 0
    return Made(log, json.loads(figures.read_text()))


@pytest.fixture(scope="module")
def stood(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """Files of a robot that stood for a moment."""
    return made(tmp_path_factory.mktemp("stood"), "stand", "--command", "0,0,0", "--seed", "3")


def test_its_log_shows_where_the_robot_is(stood: Made) -> None:
    """For every policy, because viewers need an estimate to draw balance."""
    log = read_log(stood.log, ("/odom", "/markers", "/contacts"))
    assert {entry.topic for entry in log.entries} == {"/odom", "/markers", "/contacts"}


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


def test_a_silent_motor_is_a_stop(shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
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


def test_a_short_walk_has_no_nan_and_may_go_to_a_device(shell: Shell, tmp_path: Path) -> None:
    """It is not replaced by a file of its name."""
    outcome = shell(
        "deploy", "stand", "--duration", "0.001", "--config", written(tmp_path), "--json", "/dev/null"
    )
    assert (outcome.status, outcome.err) == (0, "")
    assert "nan" not in outcome.out
    assert not Path("/dev/null").is_file()


def test_a_command_beyond_the_training_is_clipped_with_a_note(shell: Shell, tmp_path: Path) -> None:
    path = tmp_path / "run.json"
    outcome = shell(
        "deploy",
        "go1-flat",
        "--duration",
        "0.1",
        "--config",
        written(tmp_path),
        "--command",
        "5,0,0",
        "--json",
        path,
    )
    assert outcome.status == 0
    (note,) = json.loads(path.read_text())["notes"]
    assert note == "the policy was trained on forward commands from -1.2 to 1.8 m/s: 5 was clipped to 1.8"
    assert note in " ".join(outcome.out.split())


def test_a_torn_log_is_recovered_under_another_name(shell: Shell, stood: Made, tmp_path: Path) -> None:
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(stood.log.read_bytes()[:-2000])
    outcome = shell("log", "recover", torn)
    assert outcome.status == 0, outcome.err
    whole = tmp_path / "torn.recovered.mcap"
    assert str(whole) in "".join(outcome.out.split())
    assert "the same decisions" in shell("replay", whole).out
    shell.refuses("log", "recover", torn, "--out", torn)


def test_a_users_own_robot_and_policy(shell: Shell, own_folder: Path, tmp_path: Path) -> None:
    onnx = pytest.importorskip("onnx")
    declaration = own_folder / "robot.yaml"
    declaration.write_text(declaration.read_text().replace("name: go1", "name: mine"))
    walk = write_policy(onnx, tmp_path / "walk.onnx", own_folder)
    assert shell("deploy", walk, "--robot", own_folder, *SHORT, "--config", written(tmp_path)).status == 0
    assert "robot: policy has mine, robot has go1" in shell.refuses("deploy", walk, *SHORT)
    assert own_folder != ROBOTS / "go1"


def ran(**changes: Any) -> Any:
    """Figures of a run that ended safely, after late ticks."""
    timing = {
        "tick_us_p50": 1.0, "tick_us_p99": 2.0, "policy_ms_p50": 0.25, "policy_ms_p99": 4.0,
        "lateness_us_max": 9.0, "lateness_us_p50": 5.0, "lateness_us_p99": 6.0, "overruns": 7.0,
        "ticks": 800.0, "ticks_skipped": 11.0,
    }  # fmt: skip
    facts = {
        "walked_s": 1.5, "final_state": "IDLE", "faults": (), "notes": ("a note",), "buses": (),
        "wall_s": 2.0, "run_s": 3.0, "fell": False, "fall_reason": "", "distance_m": 0.7,
        "mean_velocity": np.array([0.4, -0.1, 0.2]), "timing": timing, "recoveries": (),
    }  # fmt: skip
    return SimpleNamespace(**(facts | changes))


def words(text: str) -> str:
    return " ".join(text.split())


class TestOptions:
    OPTIONS = (
        "--command", "0.1,-0.2,0.3", "--duration", "1.25", "--seed", "9", "--log", "run.mcap",
        "--json", "run.json", "--config", "loop.yaml",
    )  # fmt: skip

    def test_reach_the_simulation(self, shell: Shell, called: Recorder, go1: Robot, tmp_path: Path) -> None:
        (tmp_path / "loop.yaml").write_text("joint_rate_hz: 1000.0")
        called.replace("footfall.plant.episode.run_episode", ran())
        called.replace("footfall.live_state.live_state", "display")
        more = ("--plant", str(go1.xml_path), "--ground-truth", "--realtime")
        outcome = shell("deploy", "trot", *self.OPTIONS, *more)
        assert outcome.status == 0, outcome.err
        (robot, policy, episode), _ = called.of("run_episode")
        assert (robot.name, policy.name) == ("go1", "trot")
        assert episode.command_source.poll(WALKING).velocity.tolist() == [0.1, -0.2, 0.3]
        assert (episode.duration_s, episode.seed, episode.plant) == (1.25, 9, go1.xml_path)
        assert (episode.ground_truth, episode.realtime, episode.record) == (True, True, False)
        assert (episode.log, episode.policy_spec) == (Path("run.mcap"), "trot")
        assert episode.config == DeployConfig(joint_rate_hz=1000.0)
        assert (episode.noise, episode.pushes, episode.sample) == (None, (), None)
        assert episode.display("loop", "velocity") == "display"
        result = json.loads((tmp_path / "run.json").read_text())
        assert result.pop("settings")["gait"]["name"] == "trot"
        assert result == {
            "policy": "trot", "robot": "go1", "bus": "sim", "seed": 9, "command": [0.1, -0.2, 0.3],
            "duration_s": 1.25, "walked_s": 1.5, "final_state": "IDLE", "faults": [], "notes": ["a note"],
            "timing": ran().timing, "buses": [], "wall_s": 2.0, "run_s": 3.0, "fell": False,
            "fall_reason": "", "distance_m": 0.7, "mean_velocity_m_s": [0.4, -0.1, 0.2],
            "recoveries": [],
        }  # fmt: skip
        for fact in ("trot on go1", "IDLE", "0.70 m in 1.5 s", "0.40 m/s", "-0.10 m/s", "a note"):
            assert fact in words(outcome.out)

    def test_consent_names_the_policy_that_gets_the_robot_up(
        self, shell: Shell, called: Recorder, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fell = Recovered("tilt", 1.0, 3.5, 2)
        called.replace("footfall.plant.episode.run_episode", ran(recoveries=(fell,)))
        assert shell("deploy", "trot", "--recover", "--get-up", "stand", "--json", "a.json").status == 0
        (_, _, episode), _ = called.of("run_episode")
        assert (episode.get_up.policy.name, episode.get_up.spec) == ("stand", "stand")
        assert json.loads(Path("a.json").read_text())["recoveries"] == [fell._asdict()]
        assert "--recover" in shell.refuses("deploy", "trot", "--get-up", "stand")
        monkeypatch.setattr("footfall.policies.registry.zoo_names", lambda: [])
        assert "--get-up" in shell.refuses("deploy", "trot", "--recover")

    def test_options_set_how_a_simulated_robot_begins_and_ends(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.plant.episode.run_episode", ran())
        for options, lying, lie_down in (
            ((), False, True),
            (("--start", "lying"), True, True),
            (("--no-lie-down",), False, False),
        ):
            called.calls.clear()
            assert shell("deploy", "tripod", "--robot", "hexapod", *options, "--json", "a.json").status == 0
            (robot, policy, episode), _ = called.of("run_episode")
            assert (robot.name, policy.name) == ("hexapod", "tripod")
            assert (episode.lying, episode.lie_down) == (lying, lie_down)
        assert (episode.plant, episode.ground_truth, episode.realtime) == (None, False, False)
        assert episode.command_source.poll(WALKING).velocity.tolist() == [0.5, 0.0, 0.0]
        assert episode.duration_s == 10.0
        figures = json.loads(Path("a.json").read_text())
        assert (figures["policy"], figures["robot"]) == ("tripod", "hexapod")

    def test_only_a_safe_end_is_status_0(self, shell: Shell, called: Recorder) -> None:
        fell = {"fell": True, "fall_reason": "it tilted"}
        for outcome, status in (({}, 0), ({"final_state": "ESTOP"}, 1), (fell, 1)):
            called.replace("footfall.plant.episode.run_episode", ran(faults=("motor 3",), **outcome))
            shown = shell("deploy", "stand")
            assert shown.status == status
            assert "fault motor 3" in words(shown.out)
            assert ("it tilted" in shown.out) == ("fell" in outcome)

    @pytest.mark.parametrize("bus", ["socketcan", "virtual"])
    def test_reach_an_interface(
        self, shell: Shell, called: Recorder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, bus: str
    ) -> None:
        @contextmanager
        def serving(*given: Any, **named: Any) -> Iterator[None]:
            called.calls.append(("serving", given, named))
            yield
            called.calls.append(("served", (), {}))

        monkeypatch.setattr("footfall.plant.serve.serving", serving)
        called.replace(
            "footfall.deploy.session.run_on_interface", ran(final_state="FALLING", faults=("tilt", "x"))
        )
        called.replace("footfall.live_state.live_state", lambda _, velocity, *__, **___: velocity)
        (tmp_path / "loop.yaml").write_text("stand_s: 2.5")
        outcome = shell("deploy", "stand", "--bus", bus, *self.OPTIONS)
        assert outcome.status == 1
        (robot, policy, where, session), _ = called.of("run_on_interface")
        assert (robot.name, policy.name, where) == ("go1", "stand", bus)
        assert session.command_source.poll(WALKING).velocity.tolist() == [0.1, -0.2, 0.3]
        assert (session.duration_s, session.log, session.lie_down) == (1.25, Path("run.mcap"), True)
        assert session.facts == {"seed": 9, "policy_spec": "stand", "bus": bus, "plant": None}
        assert session.config == DeployConfig(stand_s=2.5, odometry=True)  # for the log
        loop = SimpleNamespace(estimate=("then", "height"))
        shown = session.display(loop)
        loop.estimate = ("now", "height")
        assert shown() == "now"
        order = [name for name in called.names if name != "live_state"]
        served = ["serving", "run_on_interface", "served"]
        assert order == (served if bus == "virtual" else ["run_on_interface"])
        figures = json.loads((tmp_path / "run.json").read_text())
        assert (figures["bus"], figures["fell"], figures["fall_reason"]) == (bus, True, "tilt")
        assert (figures["distance_m"], figures["mean_velocity_m_s"]) == (None, [None] * 3)
        called.calls.clear()
        shell("deploy", "stand", "--bus", bus, "--no-lie-down")
        assert called.of("run_on_interface")[0][3].lie_down is False

    def test_on_an_interface_a_robot_that_did_not_tilt_has_not_fallen(
        self, shell: Shell, called: Recorder, tmp_path: Path
    ) -> None:
        for state, status in (("IDLE", 0), ("ESTOP", 1)):
            ended = ran(final_state=state, faults=("motor 3",))
            called.replace("footfall.deploy.session.run_on_interface", ended)
            outcome = shell("deploy", "stand", "--bus", "slcan", "--json", "a.json")
            figures = json.loads((tmp_path / "a.json").read_text())
            assert (outcome.status, figures["fell"], figures["fall_reason"]) == (status, False, "")
            assert figures["faults"] == ["motor 3"]

    def test_options_for_simulation_are_refused_on_an_interface(self, shell: Shell) -> None:
        for options in (
            ("--start", "lying"),
            ("--ground-truth", "--start", "lying"),
            ("--plant", "x.xml", "--ground-truth"),
        ):
            complaint = shell.refuses("deploy", "stand", "--bus", "virtual", *options)
            assert complaint.startswith(f"{options[0]} needs the simulated robot")

    def test_a_log_names_files_by_their_path(self, shell: Shell, called: Recorder, tmp_path: Path) -> None:
        (tmp_path / "mine.yaml").write_text("kp: 45.0")
        called.replace("footfall.policies.registry.lasting_spec", lambda spec: f"lasting {spec}")
        called.replace("footfall.policies.registry.load_policy", lambda spec, robot: (spec, robot.name))
        for bus, import_path in (
            ("sim", "plant.episode.run_episode"),
            ("slcan", "deploy.session.run_on_interface"),
        ):
            called.calls.clear()
            called.replace(f"footfall.{import_path}", ran())
            options = ("--set", "stand.kd=2.5", "--bus", bus, "--json", "a.json")
            assert shell("deploy", "stand@mine.yaml", *options).status == 0
            _, policy, *_, given = called.of(import_path.rpartition(".")[2])[0]
            assert policy == ("stand@mine.yaml@kd=2.5", "go1")
            logged = given.policy_spec if bus == "sim" else given.facts["policy_spec"]
            assert logged == "lasting stand@mine.yaml@kd=2.5"
            figures = json.loads((tmp_path / "a.json").read_text())
            assert figures["policy"] == "stand@mine.yaml@kd=2.5"
            assert (figures["settings"]["kp"], figures["settings"]["kd"]) == (45.0, 2.5)
