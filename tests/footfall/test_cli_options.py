"""Every option of every verb is followed to where it acts; what acts is stood in for, and nothing runs.

Options are given with values other than their defaults, and no two of one type alike.
"""

import io
import json
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from recorder import Recorder
from shell import Shell

from footfall import cli
from footfall.common.errors import UserError
from footfall.deploy.config import DeployConfig
from footfall.evaluate.config import EvaluationConfig
from footfall.machine import Finding
from footfall.plant.episode import Episode
from footfall.robots.description import Robot
from footfall.verbs import demo, deploy, train
from footfall.verbs.train import ClusterOptions, TrainOptions


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Shell:
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def scored(*errors: str) -> dict[str, Any]:
    return {"scenarios": {"nominal": {"episodes": 4, "failed_episodes": list(errors)}}}


EVALUATION = (
    "--robot", "rex", "--scenarios", "push, nominal", "--episodes", "3", "--seed", "5", "--plant", "p.xml",
    "--ground-truth", "--workers", "2", "--json", "out.json", "--scenario-file", "own.yaml",
)  # fmt: skip
ASKED = EvaluationConfig("rex", ("push", "nominal"), 5, 3, Path("p.xml"), True, 2, Path("own.yaml"))


class TestEvaluate:
    def test_options_reach_the_evaluation_and_the_comparison(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.evaluate.api.evaluate_policy", scored())
        called.replace("footfall.evaluate.api.compare_policies", {"a": scored(), "b": scored()})
        for options, config, figures, html in (
            ((), EvaluationConfig(), None, None),
            ((*EVALUATION, "--html", "out.html"), ASKED, Path("out.json"), Path("out.html")),
        ):
            assert shell("evaluate", "mine.onnx", *options[:-2]).status == 0
            assert called.of("evaluate_policy") == (("mine.onnx", config), {"json_path": figures})
            assert shell("compare", "b", "a", *options).status == 0
            assert called.of("compare_policies") == (
                (("b", "a"), config), {"json_path": figures, "html_path": html},
            )  # fmt: skip
            called.calls.clear()

    def test_a_failed_episode_of_any_policy_is_status_1(self, shell: Shell, called: Recorder) -> None:
        called.replace(
            "footfall.evaluate.api.compare_policies", {"a": scored(), "b": scored("episode 1: no")}
        )
        outcome = shell("compare", "a", "b")
        assert (outcome.status, outcome.err) == (1, "footfall: 1 of 9 episodes failed: no (1)\n")

    def test_files_called_none_are_files(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.evaluate.api.compare_policies", {"a": scored()})
        shell("compare", "a", "--json", "none", "--html", "None", "--plant", "null")
        (_, config), asked = called.of("compare_policies")
        assert asked == {"json_path": Path("none"), "html_path": Path("None")}
        assert config.plant == Path("null")


class TestLimits:
    """The last value that is taken, beside the first that is not."""

    @pytest.mark.parametrize(
        ("option", "taken", "refused"),
        [
            ("--seed", "2147483647", "2147483648"), ("--seed", "0", "-1"), ("--episodes", "1", "0"),
            ("--workers", "1", "0"),
        ],
    )  # fmt: skip
    def test_of_numbers(self, shell: Shell, called: Recorder, option: str, taken: str, refused: str) -> None:
        called.replace("footfall.evaluate.api.evaluate_policy", scored())
        assert shell("evaluate", "stand", option, taken).status == 0
        assert getattr(called.of("evaluate_policy")[0][1], option[2:]) == int(taken)
        assert option in shell.refuses("evaluate", "stand", option, refused)

    @pytest.mark.parametrize("duration", ["0", "-1", "nan", "inf", "soon"])
    def test_of_times(self, shell: Shell, duration: str) -> None:
        assert "--duration" in shell.refuses("deploy", "stand", f"--duration={duration}")

    @pytest.mark.parametrize("names", ["", ",", "push,,nominal", "push, "])
    def test_of_names(self, shell: Shell, names: str) -> None:
        assert "expected names with commas between them" in shell.refuses(
            "evaluate", "stand", f"--scenarios={names}"
        )

    @pytest.mark.parametrize("port", ["0", "65536", "80.5"])
    def test_of_what_is_no_port(self, shell: Shell, port: str) -> None:
        assert "--port" in shell.refuses("watch", "run", "--port", port)

    @pytest.mark.parametrize("number", ["1.5", "three", "1e3"])
    def test_of_whole_numbers(self, shell: Shell, number: str) -> None:
        assert f"expected a whole number, found '{number}'" in shell.refuses(
            "evaluate", "stand", "--episodes", number
        )

    @pytest.mark.parametrize("command", ["0.5", "0.5,0", "0.5,0,0,0", "nan,0,0", "a,0,0", "0,0,101"])
    def test_of_a_velocity(self, shell: Shell, command: str) -> None:
        assert "expected three numbers such as 0.5,0,0" in shell.refuses(
            "deploy", "stand", f"--command={command}"
        )

    @pytest.mark.parametrize("port", ["1", "65535"])
    def test_of_ports(self, shell: Shell, called: Recorder, port: str) -> None:
        called.replace("footfall.pages.walk.watch")
        assert shell("watch", "run", "--host", "there", "--port", port).status == 0
        (run, host, number, stop), _ = called.of("watch")
        assert (run, host, number) == (Path("run"), "there", int(port))
        assert not stop.requested

    def test_of_commands(self, shell: Shell, called: Recorder) -> None:
        called.replace(
            "footfall.plant.episode.run_episode", lambda *_: (_ for _ in ()).throw(UserError("enough"))
        )
        assert shell.refuses("deploy", "stand", "--command", "-100,99.5,100") == "enough"
        (_, _, episode), _ = called.of("run_episode")
        assert episode.command_source(3.0).tolist() == [-100.0, 99.5, 100.0]
        assert "none beyond 100" in shell.refuses("deploy", "stand", "--command", "0,-100.1,0")


def ran(**changes: Any) -> Any:
    """What a run has to tell."""
    facts = {
        "walked_s": 1.5, "final_state": "IDLE", "faults": (), "notes": ("a note",), "buses": (),
        "wall_s": 2.0, "run_s": 3.0, "fell": False, "fall_reason": "", "distance_m": 0.7,
        "mean_velocity": np.array([0.4, -0.1, 0.2]),
        "timing": {"tick_us_p50": 1.0, "tick_us_p99": 2.0, "policy_ms_p50": 0.25, "policy_ms_p99": 4.0,
                   "lateness_us_max": 0.0},
    }  # fmt: skip
    return SimpleNamespace(**(facts | changes))


class TestDeploy:
    OPTIONS = (
        "--command", "0.1,-0.2,0.3", "--duration", "1.25", "--seed", "9", "--log", "run.mcap",
        "--json", "run.json",
    )  # fmt: skip

    def test_options_reach_the_simulated_robot(
        self, shell: Shell, called: Recorder, go1: Robot, tmp_path: Path
    ) -> None:
        (tmp_path / "loop.yaml").write_text("joint_rate_hz: 1000.0")
        called.replace("footfall.plant.episode.run_episode", ran())
        called.replace("footfall.live_state.live_state", "display")
        more = ("--plant", str(go1.xml_path), "--ground-truth", "--realtime", "--config", "loop.yaml")
        outcome = shell("deploy", "trot", *self.OPTIONS, *more)
        assert outcome.status == 0, outcome.err
        (robot, policy, episode), _ = called.of("run_episode")
        assert (robot.name, policy.name) == ("go1", "trot")
        assert isinstance(episode, Episode)
        assert episode.command_source(0.0).tolist() == [0.1, -0.2, 0.3]
        assert (episode.duration_s, episode.seed, episode.plant) == (1.25, 9, go1.xml_path)
        assert (episode.ground_truth, episode.realtime, episode.record) == (True, True, False)
        assert (episode.log, episode.policy_spec) == (Path("run.mcap"), "trot")
        assert episode.config == DeployConfig(joint_rate_hz=1000.0)
        assert (episode.noise, episode.pushes, episode.sample) == (None, (), None)
        assert episode.display("loop", "velocity") == "display"
        assert called.of("live_state") == (("loop", "velocity"), {"duration_s": 1.25})
        told = json.loads((tmp_path / "run.json").read_text())
        assert told.pop("settings")["gait"]["name"] == "trot"
        assert told == {
            "policy": "trot", "robot": "go1", "bus": "sim", "seed": 9, "command": [0.1, -0.2, 0.3],
            "duration_s": 1.25, "walked_s": 1.5, "final_state": "IDLE", "faults": [], "notes": ["a note"],
            "timing": ran().timing, "buses": [], "wall_s": 2.0, "run_s": 3.0, "fell": False,
            "fall_reason": "", "distance_m": 0.7, "mean_velocity_m_s": [0.4, -0.1, 0.2],
        }  # fmt: skip
        words = " ".join(outcome.out.split())
        for fact in (
            "trot on go1", "final state IDLE", "walked 0.70 m in 1.5 s", "0.40 m/s forward, -0.10 m/s left",
            "1.5 x real time", "1 us p50, 2 us p99", "0.25 ms p50, 4.00 ms p99", "note a note",
        ):  # fmt: skip
            assert fact in words
        assert "bus load" not in words

    def test_without_options_it_walks_ahead_for_ten_seconds(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.plant.episode.run_episode", ran())
        shell("deploy", "stand")
        (_, _, episode), _ = called.of("run_episode")
        assert episode.command_source(1.0).tolist() == [0.5, 0.0, 0.0]
        assert (episode.duration_s, episode.seed, episode.realtime, episode.log) == (10.0, 0, False, None)
        assert episode.config == DeployConfig()

    @pytest.mark.parametrize(
        ("outcome", "status"),
        [({}, 0), ({"final_state": "ESTOP"}, 1), ({"fell": True, "fall_reason": "it tilted"}, 1)],
    )
    def test_only_a_safe_end_is_status_0(
        self, shell: Shell, called: Recorder, outcome: dict[str, Any], status: int
    ) -> None:
        called.replace("footfall.plant.episode.run_episode", ran(faults=("motor 3",), **outcome))
        shown = shell("deploy", "stand")
        assert shown.status == status
        words = " ".join(shown.out.split())
        assert "fault motor 3" in words
        assert ("fell it tilted" in words) == ("fell" in outcome)

    @pytest.mark.parametrize("bus", ["socketcan", "virtual"])
    def test_options_reach_an_interface(
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
        called.replace("footfall.live_state.live_state", lambda _, velocity, __: velocity())
        (tmp_path / "loop.yaml").write_text("stand_s: 2.5")
        (tmp_path / "my").mkdir()
        outcome = shell("deploy", "stand", "--bus", bus, *self.OPTIONS, "--config", "loop.yaml")
        assert outcome.status == 1
        (robot, policy, where, session), _ = called.of("run_on_interface")
        assert (robot.name, policy.name, where) == ("go1", "stand", bus)
        assert session.command_source(0.0).tolist() == [0.1, -0.2, 0.3]
        assert (session.duration_s, session.log) == (1.25, Path("run.mcap"))
        assert session.facts == {"seed": 9, "policy_spec": "stand", "bus": bus, "plant": None}
        assert session.config == DeployConfig(stand_s=2.5)
        assert session.display(SimpleNamespace(estimate=("the velocity", "height"))) == "the velocity"
        order = [name for name in called.names if name != "live_state"]
        assert order == (
            ["serving", "run_on_interface", "served"] if bus == "virtual" else ["run_on_interface"]
        )
        if bus == "virtual":
            assert called.of("serving") == ((robot, "virtual"), {"seed": 9})
        figures = json.loads((tmp_path / "run.json").read_text())
        assert (figures["bus"], figures["fell"], figures["fall_reason"]) == (bus, True, "tilt")
        assert (figures["distance_m"], figures["mean_velocity_m_s"]) == (None, [None] * 3)
        assert "m in" not in outcome.out
        assert "mean velocity" not in outcome.out

    @pytest.mark.parametrize(("option", "value"), [("--plant", "x.xml"), ("--ground-truth", None)])
    def test_what_needs_a_simulation_is_refused_on_an_interface(
        self, shell: Shell, option: str, value: str | None
    ) -> None:
        tokens = [option] if value is None else [option, value]
        assert f"{option} needs the simulated robot" in shell.refuses(
            "deploy", "stand", "--bus", "virtual", *tokens
        )

    def test_bus_loads_are_shown_where_they_are_known(self, capsys: pytest.CaptureFixture[str]) -> None:
        buses = [
            {"name": "can0", "load": 0.42},
            {"name": "can1", "load": None},
            {"name": "can2", "load": 0.5},
        ]
        shared = {
            key: vars(ran())[key] for key in ("timing", "walked_s", "final_state", "faults", "notes", "run_s")
        }
        deploy._show(
            shared | {"buses": buses, "mean_velocity_m_s": [0.0] * 3, "distance_m": 0.0, "wall_s": 0.0,
                      "fell": False, "policy": "p", "robot": "r"}
        )  # fmt: skip
        assert "can0 42%, can2 50%" in capsys.readouterr().out


class TestReplay:
    @pytest.fixture
    def log(self, called: Recorder, go1: Robot) -> dict[str, str]:
        """What the log names."""
        named = {
            "policy_spec": "trot",
            "robot": "go1",
            "robot_folder": "/nowhere",
            "robot_digest": go1.digest,
        }
        called.replace("footfall.deploy.log_file.read_log", SimpleNamespace(text=named.__getitem__))
        result = SimpleNamespace(
            steps=7, complete=True, damaged=0, first_difference="", worst_difference=0.00123
        )
        called.replace("footfall.deploy.replay.replay", result)
        self.result = result
        return named

    def test_by_default_it_asks_the_logs_own_policy_for_the_very_same(
        self, shell: Shell, called: Recorder, log: dict[str, str]
    ) -> None:
        outcome = shell("replay", "run.mcap")
        assert (outcome.status, outcome.out) == (
            0,
            "7 policy steps\nthe same decisions (worst difference 0.00123)\n",
        )
        (path, policy, tolerance), _ = called.of("replay")
        assert (path, policy.name, tolerance) == (Path("run.mcap"), "trot", 0.0)

    def test_options_stand_above_what_the_log_names(self, shell: Shell, called: Recorder, log: dict) -> None:
        log |= {"robot": "rex", "policy_spec": "gone.onnx"}
        self.result.first_difference, self.result.complete = "step 3", False
        outcome = shell("replay", "run.mcap", "--policy", "stand", "--robot", "go1", "--tolerance", "0.25")
        assert outcome.status == 1
        assert outcome.out.splitlines() == [
            "7 policy steps, of a run that was cut short", "first difference: step 3",
            "worst difference: 0.00123",
        ]  # fmt: skip
        (_, policy, tolerance), _ = called.of("replay")
        assert (policy.name, tolerance) == ("stand", 0.25)
        assert "read_log" not in called.names

    def test_one_of_them_leaves_the_other_to_the_log(self, shell: Shell, called: Recorder, log: dict) -> None:
        assert shell("replay", "run.mcap", "--policy", "stand").status == 0
        assert called.of("replay")[0][1].name == "stand"
        called.calls.clear()
        assert shell("replay", "run.mcap", "--robot", "go1").status == 0
        assert called.of("replay")[0][1].name == "trot"

    def test_a_robot_is_found_in_its_folder_where_its_name_means_another(
        self, shell: Shell, called: Recorder, log: dict, own_folder: Path
    ) -> None:
        log["robot_folder"] = str(own_folder)
        yaml = own_folder / "robot.yaml"
        yaml.write_text(yaml.read_text().replace("default_rad: 0.9", "default_rad: 0.8"))
        assert "gone" not in shell("replay", "run.mcap").err
        called.calls.clear()
        from footfall.robots.description import load_robot

        log["robot_digest"] = load_robot(own_folder).digest
        assert shell("replay", "run.mcap").status == 0
        assert called.of("replay")[0][1].name == "trot"
        log["robot_digest"] = "another"
        assert "has changed since: give --robot" in shell.refuses("replay", "run.mcap")


class TestTrain:
    @pytest.fixture
    def trained(self, called: Recorder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """All that a training calls."""
        run = SimpleNamespace(
            policy=tmp_path / "policy.onnx", provenance=SimpleNamespace(robot="rex", seed=5)
        )
        run.policy.touch()
        state = SimpleNamespace(run=run, main=True)

        @contextmanager
        def watched(*given: Any) -> Iterator[None]:
            called.calls.append(("watched", given, {}))
            yield
            called.calls.append(("unwatched", (), {}))

        for place, answer in (
            ("footfall.train.api.begin", lambda _: tmp_path), ("footfall.train.api.resume", None),
            ("footfall.train.api.cluster.join", None),
            ("footfall.train.api.cluster.is_main_process", lambda: state.main),
            ("footfall.train.runs.folder.open_run", lambda _: run),
            ("footfall.verbs.train.start_device", None), ("footfall.pages.page.check_page", None),
            ("footfall.evaluate.api.evaluate_policy", scored()),
        ):  # fmt: skip
            called.replace(place, answer)
        monkeypatch.setattr("footfall.pages.beside.watched", watched)
        return state

    def test_options_reach_the_request(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace
    ) -> None:
        options = (
            "--robot", "rex", "--preset", "gpu", "--seed", "4", "--out", "there", "--steps", "1000",
            "--checkpoint-interval", "2.5", "--trainer", "rsl_rl",
        )  # fmt: skip
        assert shell("train", *options).status == 0
        ((request,), _) = called.of("begin")
        assert vars(request) == {
            "robot": "rex", "preset": "gpu", "seed": 4, "out": Path("there"), "total_steps": 1000,
            "checkpoint_interval_s": 2.5, "trainer": "rsl_rl",
        }  # fmt: skip
        assert called.names == [
            "start_device", "begin", "is_main_process", "resume", "open_run", "evaluate_policy",
        ]  # fmt: skip

    def test_what_is_not_asked_for_is_left_to_the_request(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace
    ) -> None:
        from footfall.train.api import TrainRequest

        assert shell("train").status == 0
        assert called.of("begin") == ((TrainRequest(),), {})

    def test_the_finished_policy_is_evaluated_with_the_runs_robot_and_seed(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace, tmp_path: Path
    ) -> None:
        shell("train")
        assert called.of("evaluate_policy") == (
            (str(tmp_path), EvaluationConfig("rex", ("gentle",), 5)),
            {"json_path": tmp_path / "evaluation.json"},
        )  # fmt: skip
        assert called.of("resume") == ((tmp_path,), {})

    @pytest.mark.parametrize(("older_s", "walks"), [(5, True), (0, False), (-5, False)])
    def test_a_policy_walks_again_if_it_is_newer_than_its_evaluation(
        self,
        shell: Shell,
        called: Recorder,
        trained: SimpleNamespace,
        tmp_path: Path,
        older_s: int,
        walks: bool,
    ) -> None:
        (tmp_path / "evaluation.json").touch()
        os.utime(trained.run.policy, (1000, 1000))
        os.utime(tmp_path / "evaluation.json", (1000 - older_s, 1000 - older_s))
        assert shell("train").status == 0
        assert ("evaluate_policy" in called.names) == walks

    def test_a_failed_episode_of_it_is_status_1(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace
    ) -> None:
        called.replace("footfall.evaluate.api.evaluate_policy", scored("episode 0: no"))
        assert shell("train").status == 1

    def test_it_is_not_evaluated_if_not_wanted(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace
    ) -> None:
        assert shell("train", "--no-evaluate").status == 0
        trained.main = False
        assert shell("train").status == 0
        assert "evaluate_policy" not in called.names

    def test_a_resumed_run_goes_on_where_it_is(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace, tmp_path: Path
    ) -> None:
        assert shell("train", "--resume", tmp_path / "mine").status == 0
        assert called.names[:4] == ["open_run", "start_device", "is_main_process", "resume"]
        assert called.of("resume") == ((tmp_path / "mine",), {})
        assert "begin" not in called.names

    @pytest.mark.parametrize(
        "option", [("--out", "x"), ("--steps", "9"), ("--checkpoint-interval", "3"), ("--trainer", "rsl_rl")]
    )
    def test_with_settings_of_its_own(self, shell: Shell, option: tuple[str, str]) -> None:
        assert f"leave {option[0]} out" in shell.refuses("train", "--resume", "run", *option)

    @pytest.mark.parametrize("option", [("--host", "there"), ("--port", "9000")])
    def test_a_page_that_nobody_asked_for_has_no_address(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace, option: tuple[str, str]
    ) -> None:
        assert "add --watch, or leave them out" in shell.refuses("train", *option)
        assert called.names == []

    @pytest.mark.parametrize(
        "option", [("--seed", "0"), ("--seed", "3"), ("--preset", "gpu"), ("--robot", "go1")]
    )
    def test_a_resumed_run_has_its_own_robot_preset_and_seed(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace, option: tuple[str, str]
    ) -> None:
        assert f"leave {option[0]} out" in shell.refuses("train", "--resume", "run", *option)
        assert called.names == []

    def test_a_resumed_run_may_be_watched_and_left_unevaluated(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace, tmp_path: Path
    ) -> None:
        assert shell("train", "--resume", tmp_path, "--watch", "--no-evaluate").status == 0
        assert called.of("watched") == ((tmp_path, "localhost", 8080), {})
        assert "evaluate_policy" not in called.names

    def test_several_processes_join_before_the_run_begins(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace
    ) -> None:
        cluster = ("--coordinator", "host:12", "--processes", "3", "--process", "2")
        assert shell("train", *cluster).status == 0
        assert called.of("join") == (("host:12", 3, 2), {})
        assert called.names[:2] == ["join", "begin"]  # and no device before: it is one of several
        called.calls.clear()
        assert shell("train", "--coordinator", "auto").status == 0
        assert called.of("join") == (("auto", None, None), {})

    def test_the_page_is_served_where_it_was_asked_for_while_it_trains(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace, tmp_path: Path
    ) -> None:
        outcome = shell("train", "--watch", "--host", "0.0.0.0", "--port", "9000")
        assert outcome.status == 0
        assert called.of("check_page") == (("0.0.0.0", 9000), {})
        assert called.of("watched") == ((tmp_path, "0.0.0.0", 9000), {})
        order = [
            name for name in called.names if name in ("check_page", "begin", "watched", "resume", "unwatched")
        ]
        assert order == ["check_page", "begin", "watched", "resume", "unwatched"]
        assert outcome.out.startswith(
            "watch it learn at http://0.0.0.0:9000, and afterwards with: footfall watch "
        )

    @pytest.mark.parametrize(
        ("cluster", "first"),
        [
            (ClusterOptions(), True), (ClusterOptions("auto"), False), (ClusterOptions("h:1", 2, 0), True),
            (ClusterOptions("h:1", 2, 1), False),
        ],
    )  # fmt: skip
    def test_who_may_serve_the_page(self, cluster: ClusterOptions, first: bool) -> None:
        assert train._may_be_main_process(cluster) is first

    @pytest.mark.parametrize(
        ("cluster", "complaint"),
        [
            (ClusterOptions("h:65535", 2, 1), ""), (ClusterOptions("[fe80::1]:80", 1, 0), ""),
            (ClusterOptions("auto"), ""), (ClusterOptions("h:0", 2, 1), "expected HOST:PORT"),
            (ClusterOptions("h:1", 2, 2), "of 2 the last is 1"),
            (ClusterOptions("h:1", None, 0), "need --coordinator"),
            (ClusterOptions(None, 2, 1), "need --coordinator"),
            (ClusterOptions("auto", 2, 0), "need --coordinator"),
        ],
    )  # fmt: skip
    def test_what_is_a_cluster(self, cluster: ClusterOptions, complaint: str) -> None:
        if not complaint:
            train._check_cluster(cluster)
        else:
            with pytest.raises(UserError, match=complaint):
                train._check_cluster(cluster)

    def test_nothing_is_asked_for_by_default(self) -> None:
        assert train._requested(TrainOptions()) == {}


class TestOtherVerbs:
    def test_export_writes_where_it_is_told(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.train.api.export_run", (Path("x.onnx"), 1.25e-7))
        for options, out in ((("--out", "mine.onnx"), Path("mine.onnx")), ((), None)):
            called.calls.clear()
            outcome = shell("export", "run", *options)
            assert called.of("export_run") == ((Path("run"), out), {})
            assert (
                outcome.out
                == "wrote x.onnx; its actions differ from the trained network's by at most 1.2e-07\n"
            )

    @pytest.mark.parametrize(("reason", "status"), [("nan again", 0), (None, 1)])
    def test_diagnose_tells_what_broke_first(
        self, shell: Shell, called: Recorder, reason: str | None, status: int
    ) -> None:
        failure = SimpleNamespace(iteration=12, reason="nan then")
        found = SimpleNamespace(
            failure=failure,
            differences=["another JAX", "a CPU"],
            reason=reason,
            finding="the reward",
            saved=Path("s.npz"),
        )
        called.replace("footfall.train.api.diagnose", found)
        outcome = shell("diagnose", "run")
        assert outcome.status == status
        assert outcome.out.splitlines() == [
            "the replay is approximate: it failed with another JAX; a CPU",
            "iteration 12 failed then: nan then",
            f"iteration 12 fails now: {reason or 'no, it does not'}",
            "first: the reward",
            "the environment before that step is in s.npz",
        ]
        ((run,), named) = called.of("diagnose")
        assert run == Path("run")
        named["say"]("in between")
        found.differences, found.saved = [], None
        called.calls.clear()
        assert len(shell("diagnose", "run").out.splitlines()) == 3

    def test_a_recovered_log_lies_beside_its_file_unless_told_otherwise(
        self, shell: Shell, called: Recorder, tmp_path: Path
    ) -> None:
        called.replace("footfall.deploy.recover.recover", SimpleNamespace(messages=42, damaged=0))
        (tmp_path / "logs").mkdir()
        outcome = shell("log", "recover", "logs/walk.mcap")
        assert called.of("recover") == ((Path("logs/walk.mcap"), Path("logs/walk.recovered.mcap")), {})
        assert outcome.out == f"42 messages in {Path('logs/walk.recovered.mcap')}\n"
        called.calls.clear()
        shell("log", "recover", "logs/walk.mcap", "--out", "none")
        assert called.of("recover")[0][1] == Path("none")

    def test_doctor_shows_what_it_finds_and_how_to_mend_it(self, shell: Shell, called: Recorder) -> None:
        advice = "pip install 'footfall[everything]' and much more besides, in one line " + "to copy " * 9
        found = [Finding("processors", True, "2 cores"), Finding("packages", False, "jax is missing", advice)]
        called.replace("footfall.machine.findings", found)
        lines = [line.split() for line in shell("doctor").out.splitlines()]
        assert lines[0] == ["ok", "processors", "2", "cores"]
        assert lines[1] == ["--", "packages", "jax", "is", "missing"]
        assert lines[2:] == [f"packages: {advice}".split()]


class TestSweep:
    @pytest.fixture
    def swept(self, called: Recorder) -> SimpleNamespace:
        pytest.importorskip("ray")
        from footfall.train.sweeps.results import Point, Trial

        settings = {"ppo.clip_param": 0.2, "ppo.num_learning_epochs": 3}
        trial = Trial(folder="trial-0", settings=settings, seed=4, value=1.23456, steps=12345, error="")
        point = Point(settings=settings, mean=2.34567, spread=0.5, seeds=3, failed=0)
        state = SimpleNamespace(trials=[trial], points=[point], unfinished=0)
        answer = lambda *_: (state.trials, state.points, state.unfinished)  # noqa: E731
        called.replace("footfall.train.sweeps.sweep.sweep", answer)
        called.replace("footfall.train.sweeps.sweep.resume_sweep", answer)
        return state

    def test_options_and_tables(self, shell: Shell, called: Recorder, swept: SimpleNamespace) -> None:
        outcome = shell("sweep", "space.yaml", "--out", "mine")
        assert outcome.status == 0
        assert called.of("sweep") == ((Path("space.yaml"), Path("mine")), {})
        words = [line.split() for line in outcome.out.splitlines()]
        assert ["trial-0", "4", "0.2", "3", "1.235", "12,345"] in words
        assert ["0.2", "3", "2.346", "±", "0.5", "3"] in words
        assert "wrote mine/" in outcome.out

    def test_a_sweep_is_resumed_in_its_folder(
        self, shell: Shell, called: Recorder, swept: SimpleNamespace
    ) -> None:
        assert shell("sweep", "--resume", "mine").status == 0
        assert called.of("resume_sweep") == ((Path("mine"),), {})
        assert "leave --out out" in shell.refuses("sweep", "--resume", "mine", "--out", "x")
        assert "give either" in shell.refuses("sweep")
        assert "give either" in shell.refuses("sweep", "a.yaml", "--resume", "mine")

    def test_what_failed_or_is_left_ends_in_its_status(
        self, shell: Shell, called: Recorder, swept: SimpleNamespace
    ) -> None:
        swept.trials = [
            swept.trials[0],
            swept.trials[0]._replace(error="it broke"),
        ]
        outcome = shell("sweep", "space.yaml", "--out", "mine")
        assert outcome.status == 1
        assert "it broke" in outcome.out
        swept.unfinished = 2
        outcome = shell("sweep", "space.yaml", "--out", "mine")
        assert outcome.status == 130
        assert "2 unfinished; continue with: footfall sweep --resume mine" in outcome.out


class TestDemo:
    @pytest.fixture
    def steps(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        found: list[Any] = []
        monkeypatch.setattr(demo, "_step", lambda *tokens, **named: found.append((tokens, named)))
        return found

    def test_its_steps_to_the_letter(self, shell: Shell, steps: list[Any], called: Recorder) -> None:
        called.replace("footfall.policies.registry.zoo_names", ["go1-flat"])
        called.replace("footfall.policies.registry.walking_controllers", ["trot", "mpc"])
        outcome = shell(
            "demo",
            "--out",
            "d",
            "--seed",
            "7",
            "--episodes",
            "3",
            "--preset",
            "smoke",
            "--scenarios",
            "push,gentle",
        )
        assert outcome.status == 0, outcome.err
        shared = "--robot go1 --seed 7"
        assert [(" ".join(tokens), named) for tokens, named in steps] == [
            (f"train {shared} --no-evaluate --preset smoke --out d/trained", {}),
            ("export d/trained --out d/policy.onnx", {}),
            (
                f"deploy d/trained {shared} --command 0.5,0,0 --duration 10"
                " --log d/walk.mcap --json d/walk.json",
                {"tolerated": (1,)},
            ),
            (
                f"compare d/trained go1-flat trot mpc {shared} --scenarios push,gentle --episodes 3"
                " --json d/compare.json --html d/report.html",
                {},
            ),
        ]
        assert outcome.out == f"\nthe report is at {Path('d/report.html').resolve()}\n"

    def test_without_a_folder_it_makes_one_named_by_the_time(
        self, shell: Shell, steps: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(demo, "datetime", SimpleNamespace(now=lambda: datetime(2026, 3, 4, 5, 6, 7)))
        assert shell("demo").status == 0
        assert steps[1][0][1] == "runs/demo-20260304-050607/trained"
        compared = steps[3][0]
        assert compared[compared.index("--scenarios") + 1] == "gentle,push"
        assert compared[compared.index("--episodes") + 1] == "8"

    @pytest.mark.parametrize(
        ("option", "complaint"),
        [
            (("--preset", "huge"), "no preset 'huge'"),
            (("--scenarios", "gentle,ballet"), "no scenario 'ballet'"),
            (("--robot", "rex"), "no robot 'rex'"),
        ],
    )
    def test_what_does_not_exist_is_known_before_the_first_step(
        self, shell: Shell, steps: list[Any], option: tuple[str, str], complaint: str
    ) -> None:
        assert complaint in shell.refuses("demo", "--out", "d", *option)
        assert steps == []

    def test_an_empty_folder_will_do(self, shell: Shell, steps: list[Any], tmp_path: Path) -> None:
        (tmp_path / "empty").mkdir()
        assert shell("demo", "--out", "empty").status == 0
        (tmp_path / "file").touch()
        assert "not empty" in shell.refuses("demo", "--out", "file")

    def test_a_step_is_a_process_of_its_own_and_its_status_counts(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        started: list[Any] = []
        monkeypatch.setattr(
            demo.subprocess, "Popen", lambda tokens: started.append(tokens) or SimpleNamespace(wait=lambda: 1)
        )
        demo._step("deploy", "x", tolerated=(1,))
        assert started == [[sys.executable, "-P", "-m", "footfall", "deploy", "x"]]
        assert capsys.readouterr().out == "\n$ footfall deploy x\n"
        with pytest.raises(UserError, match="deploy failed with status 1"):
            demo._step("deploy", "x", tolerated=(2,))


class TestEndings:
    """What becomes of whatever a verb ends in."""

    @pytest.mark.parametrize(
        ("verb", "status", "told"),
        [
            (lambda: None, 0, ""), (lambda: 3, 3, ""), (lambda: "text", 0, ""),
            (UserError("a\n  b"), 2, "footfall: a b\n"), (OSError(28, "No space left"), 2, "No space left"),
            (KeyboardInterrupt(), 130, "footfall: interrupted\n"),
            (cli._TerminatedError(), 143, "footfall: terminated\n"),
            (BrokenPipeError(32, "Broken pipe"), 141, ""), (SystemExit(1), 141, ""),
        ],
    )  # fmt: skip
    def test_status_and_line(
        self,
        shell: Shell,
        monkeypatch: pytest.MonkeyPatch,
        verb: Callable | BaseException,
        status: int,
        told: str,
    ) -> None:
        def app(*_: Any, **__: Any) -> Any:
            if isinstance(verb, BaseException):
                raise verb
            return verb()

        monkeypatch.setattr("footfall.cli.app", app)
        monkeypatch.setattr("footfall.cli._stop_writing", lambda: None)
        outcome = shell("train")
        assert outcome.status == status
        assert told in outcome.err
        assert outcome.err.count("\n") == (1 if told else 0)

    def test_a_defect_keeps_its_traceback(self, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
        def app(*_: Any, **__: Any) -> None:
            raise ZeroDivisionError

        monkeypatch.setattr("footfall.cli.app", app)
        with pytest.raises(ZeroDivisionError):
            shell("train")

    def test_of_arguments_that_nobody_asked_for_the_first_is_told(self, shell: Shell) -> None:
        assert shell.refuses("doctor", "one", "two").startswith("unexpected argument 'one' (see")
        assert ". (see" not in shell.refuses("watch")

    def test_output_that_reaches_nobody_is_noticed_before_the_end(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """What is printed may wait in a buffer until the process ends, and its failure with it."""

        class Pipe(io.StringIO):
            def flush(self) -> None:
                raise BrokenPipeError

        monkeypatch.setattr("footfall.cli.app", lambda *_, **__: 0)
        monkeypatch.setattr("footfall.cli._stop_writing", lambda: None)
        monkeypatch.setattr(sys, "stdout", Pipe())
        assert cli.main(["doctor"]) == 141

    def test_a_polite_kill_is_for_a_verb_and_for_nobody_after_it(
        self, shell: Shell, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("footfall.cli.app", lambda *_, **__: signal.raise_signal(signal.SIGTERM))
        before = signal.getsignal(signal.SIGTERM)
        outcome = shell("doctor")
        assert (outcome.status, outcome.err) == (143, "footfall: terminated\n")
        assert signal.getsignal(signal.SIGTERM) is before

    def test_a_thread_that_gets_no_signals_may_run_a_verb(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("footfall.cli.app", lambda *_, **__: 7)
        statuses: list[int] = []
        thread = threading.Thread(target=lambda: statuses.append(cli.main(["doctor"])))
        thread.start()
        thread.join()
        assert statuses == [7]

    def test_a_name_that_the_terminal_cannot_show_is_shown_by_its_codes(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        written = io.BytesIO()
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, "ascii"))
        cli._print_any_name()
        print("caf\xe9", flush=True)
        assert written.getvalue() == b"caf\\xe9\n"

    def test_where_to_look_is_the_verbs_own_help(self, shell: Shell) -> None:
        assert shell.refuses("watch").endswith("(see footfall watch --help)")
        assert shell.refuses("dance").endswith("(see footfall --help)")
        assert shell.refuses("").endswith("(see footfall --help)")
        assert "an empty argument" in shell.refuses("watch", "run", "--host", "")
