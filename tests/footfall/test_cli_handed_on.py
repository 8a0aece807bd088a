"""What verbs hand on and tell beyond their main way: rarer options, defaults, second outcomes."""

import io
import json
import math
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from recorder import Recorder
from shell import Shell

from footfall import cli
from footfall.common.errors import UserError
from footfall.evaluate.config import EvaluationConfig
from footfall.robots.description import Robot
from footfall.verbs import demo
from footfall.verbs import list as list_verb
from footfall.verbs import sweep as sweep_verb
from footfall.verbs import train as train_verb

TIMING = {
    "tick_us_p50": 1.0, "tick_us_p99": 2.0, "policy_ms_p50": 3.0, "policy_ms_p99": 4.0,
    "lateness_us_max": 9.0, "lateness_us_p50": 5.0, "lateness_us_p99": 6.0, "overruns": 7.0, "ticks": 800.0,
    "ticks_skipped": 11.0,
}  # fmt: skip


@pytest.fixture
def shell(capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Shell:
    monkeypatch.chdir(tmp_path)
    return Shell(capsys)


def words(text: str) -> str:
    return " ".join(text.split())


class TestCommandLine:
    def test_every_verb_is_there_under_its_own_name_and_says_what_it_does(self) -> None:
        verbs = {name: cli.app[name] for name in cli.app.resolved_commands() if not name.startswith("-")}
        assert " ".join(verbs) == (
            "train sweep watch evaluate export deploy compare replay log robot can bring-up demo diagnose"
            " doctor list"
        )
        assert all(verb.help for verb in verbs.values())

    def test_a_complaint_of_what_the_terminal_cannot_show_is_by_its_codes(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        written = io.BytesIO()
        monkeypatch.setattr(sys, "stderr", io.TextIOWrapper(written, "ascii", write_through=True))
        assert cli.main(["doctor", "caf\xe9"]) == 2
        assert b"unexpected argument 'caf\\xe9'" in written.getvalue()

    @pytest.mark.parametrize("name", ["stdout", "stderr"])
    def test_an_output_that_is_closed_swallows_what_is_printed(
        self, monkeypatch: pytest.MonkeyPatch, name: str
    ) -> None:
        monkeypatch.setattr(sys, name, None)
        cli._open_what_is_closed()
        print("x", file=getattr(sys, name), flush=True)
        assert getattr(sys, name).writable()

    def test_arguments_are_those_of_the_process_without_its_name(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        given: list[Any] = []
        monkeypatch.setattr(cli, "app", lambda tokens, **named: given.append((tokens, named)))
        monkeypatch.setattr(sys, "argv", ["footfall", "list", "--json"])
        assert cli.main() == 0
        how = {"exit_on_error": False, "print_error": False, "result_action": "return_value"}
        assert given == [(["list", "--json"], how)]

    def test_a_day_is_the_longest_time(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.robots.description.load_robot", refused)
        assert shell.refuses("can", "monitor", "--duration", "86400") == "enough"

    @pytest.mark.parametrize("process", ["-1", "1.0"])
    def test_a_process_has_a_number_from_0_on(self, shell: Shell, process: str) -> None:
        cluster = ("--coordinator", "h:1", "--processes", "2", "--process", process)
        assert "--process" in shell.refuses("train", *cluster)

    def test_a_page_is_served_on_this_machine_alone_unless_asked_for(
        self, shell: Shell, called: Recorder
    ) -> None:
        called.replace("footfall.pages.walk.watch")
        assert shell("watch", "run").status == 0
        assert called.of("watch")[0][:3] == (Path("run"), "localhost", 8080)


def refused(*_: Any, **__: Any) -> None:
    raise UserError("enough")


class TestEvaluate:
    def test_a_controllers_other_settings_are_what_is_evaluated(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.evaluate.api.evaluate_policy", {"scenarios": {}})
        changes = ("--set", "stand.kd=2.5", "--set", "stand.kp=50")
        assert shell("evaluate", "stand", *changes).status == 0
        assert called.of("evaluate_policy")[0][0] == "stand@kd=2.5@kp=50"


def ran(**changes: Any) -> Any:
    """What a run has to tell: it ended safely, after ticks that came late."""
    facts = {
        "walked_s": 1.5, "final_state": "IDLE", "faults": (), "notes": (), "buses": (), "wall_s": 2.0,
        "run_s": 3.0, "fell": False, "fall_reason": "", "distance_m": 0.7, "mean_velocity": np.zeros(3),
        "timing": TIMING,
    }  # fmt: skip
    return SimpleNamespace(**(facts | changes))


class TestDeploy:
    @pytest.mark.parametrize(
        ("options", "lying", "lie_down"),
        [
            ((), False, True),
            (("--start", "standing"), False, True),
            (("--start", "lying"), True, True),
            (("--no-lie-down",), False, False),
        ],
    )
    def test_how_a_simulated_robot_begins_and_ends(
        self, shell: Shell, called: Recorder, options: tuple[str, ...], lying: bool, lie_down: bool
    ) -> None:
        called.replace("footfall.plant.episode.run_episode", ran())
        assert shell("deploy", "stand", *options).status == 0
        (_, _, episode), _ = called.of("run_episode")
        assert (episode.lying, episode.lie_down) == (lying, lie_down)
        assert (episode.plant, episode.ground_truth) == (None, False)

    @pytest.mark.parametrize(
        ("options", "first"),
        [
            (("--start", "lying"), "--start"),
            (("--start", "lying", "--ground-truth"), "--ground-truth"),
            (("--ground-truth", "--plant", "x.xml"), "--plant"),
        ],
    )
    def test_of_what_needs_a_simulated_robot_the_first_is_told(
        self, shell: Shell, options: tuple[str, ...], first: str
    ) -> None:
        complaint = shell.refuses("deploy", "stand", "--bus", "virtual", *options)
        assert complaint == f"{first} needs the simulated robot: leave --bus at 'sim'"

    def test_another_robot_is_the_one_that_walks(
        self, shell: Shell, called: Recorder, tmp_path: Path
    ) -> None:
        called.replace("footfall.plant.episode.run_episode", ran())
        outcome = shell("deploy", "tripod", "--robot", "hexapod", "--json", "a.json")
        (robot, policy, _), _ = called.of("run_episode")
        assert (robot.name, policy.name) == ("hexapod", "tripod")
        figures = json.loads((tmp_path / "a.json").read_text())
        assert (figures["policy"], figures["robot"]) == ("tripod", "hexapod")
        assert "tripod on hexapod" in outcome.out

    def test_a_log_names_a_file_by_where_it_lies_and_the_figures_as_it_was_typed(
        self, shell: Shell, called: Recorder, tmp_path: Path
    ) -> None:
        (tmp_path / "mine.yaml").write_text("kp: 45.0")
        called.replace("footfall.policies.registry.lasting_spec", lambda spec: f"lasting {spec}")
        called.replace("footfall.policies.registry.load_policy", lambda spec, robot: (spec, robot.name))
        for bus, place in (
            ("sim", "plant.episode.run_episode"),
            ("slcan", "deploy.session.run_on_interface"),
        ):
            called.calls.clear()
            called.replace(f"footfall.{place}", ran())
            options = ("--set", "stand.kd=2.5", "--bus", bus, "--json", "a.json")
            assert shell("deploy", "stand@mine.yaml", *options).status == 0
            _, policy, *_, given = called.of(place.rpartition(".")[2])[0]
            assert policy == ("stand@mine.yaml@kd=2.5", "go1")
            logged = given.policy_spec if bus == "sim" else given.facts["policy_spec"]
            assert logged == "lasting stand@mine.yaml@kd=2.5"
            figures = json.loads((tmp_path / "a.json").read_text())
            assert figures["policy"] == "stand@mine.yaml@kd=2.5"
            assert (figures["settings"]["kp"], figures["settings"]["kd"]) == (45.0, 2.5)

    @pytest.mark.parametrize(("state", "status"), [("IDLE", 0), ("ESTOP", 1)])
    def test_who_does_not_tip_over_on_an_interface_has_not_fallen(
        self, shell: Shell, called: Recorder, tmp_path: Path, state: str, status: int
    ) -> None:
        called.replace(
            "footfall.deploy.session.run_on_interface", ran(final_state=state, faults=("motor 3",))
        )
        outcome = shell("deploy", "stand", "--bus", "slcan", "--json", "a.json")
        figures = json.loads((tmp_path / "a.json").read_text())
        assert (outcome.status, figures["fell"], figures["fall_reason"]) == (status, False, "")
        assert figures["faults"] == ["motor 3"]
        (_, _, _, session), _ = called.of("run_on_interface")
        assert session.log is None
        assert session.command_source(1.0).tolist() == [0.5, 0.0, 0.0]
        assert (session.duration_s, session.facts["seed"]) == (10.0, 0)

    def test_what_is_shown_on_an_interface_is_the_estimate_of_now(
        self, shell: Shell, called: Recorder
    ) -> None:
        called.replace("footfall.deploy.session.run_on_interface", ran())
        called.replace("footfall.live_state.live_state", lambda *given: given)
        shell("deploy", "stand", "--bus", "slcan", "--duration", "1.25")
        loop = SimpleNamespace(estimate=("then", 0.3))
        shown, velocity, duration_s = called.of("run_on_interface")[0][3].display(loop)
        loop.estimate = ("now", 0.3)
        assert (shown, velocity(), duration_s) == (loop, "now", 1.25)

    def test_a_robot_of_a_folder_is_told_by_its_name(
        self, shell: Shell, called: Recorder, own_folder: Path, tmp_path: Path
    ) -> None:
        called.replace("footfall.plant.episode.run_episode", ran())
        assert shell("deploy", "stand", "--robot", own_folder, "--json", "a.json").status == 0
        assert json.loads((tmp_path / "a.json").read_text())["robot"] == "go1"

    def test_a_bus_that_carried_nothing_is_shown_as_such(self, shell: Shell, called: Recorder) -> None:
        @dataclass
        class Load:
            name: str
            load: float | None

        buses = (Load("can0", 0.0), Load("can1", None))
        called.replace("footfall.plant.episode.run_episode", ran(buses=buses))
        told = words(shell("deploy", "stand", "--json", "a.json").out)
        assert "bus load can0 0%" in told
        assert "can1" not in told

    def test_ticks_that_came_late_are_told(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.plant.episode.run_episode", ran())
        told = words(shell("deploy", "stand").out)
        assert "lateness 5 us p50, 6 us p99" in told
        assert "took too long 7 of 800 ticks, 11 were left out" in told
        called.replace(
            "footfall.plant.episode.run_episode", ran(timing=TIMING | {"lateness_us_max": 0.0}, wall_s=0.0)
        )
        told = words(shell("deploy", "stand").out)
        assert "lateness" not in told
        assert "took too long" not in told


class TestReplay:
    @pytest.fixture
    def log(self, called: Recorder, go1: Robot) -> dict[str, Any]:
        """What the log names; `result` is what came of its replay."""
        named: dict[str, Any] = {
            "policy_spec": "its policy", "robot": "its name", "robot_folder": "/its/folder",
            "robot_digest": go1.digest,
        }  # fmt: skip
        named["result"] = SimpleNamespace(
            steps=7, complete=True, damaged=0, first_difference="", worst_difference=0.0
        )
        called.replace("footfall.deploy.log_file.read_log", SimpleNamespace(text=named.__getitem__))
        called.replace("footfall.deploy.replay.replay", lambda *_: named["result"])
        called.replace("footfall.policies.registry.load_policy", "the policy")
        called.replace("footfall.robots.description.load_robot", lambda _: go1)
        return named

    @pytest.mark.parametrize(
        ("options", "robot", "policy"),
        [
            ((), "its name", "its policy"),
            (("--policy", "mine"), "its name", "mine"),
            (("--robot", "rex"), "rex", "its policy"),
            (("--policy", "mine", "--robot", "rex"), "rex", "mine"),
        ],
    )
    def test_which_policy_of_which_robot(
        self, shell: Shell, called: Recorder, log: dict, go1: Robot, options: tuple, robot: str, policy: str
    ) -> None:
        assert shell("replay", "a.mcap", *options).status == 0
        assert called.of("load_robot") == ((robot,), {})
        assert called.of("load_policy") == ((policy, go1), {})
        assert called.of("replay") == ((Path("a.mcap"), "the policy", 0.0), {})
        if "read_log" in called.names:
            assert called.of("read_log") == ((Path("a.mcap"),), {"topics": ()})

    def test_the_folder_is_looked_into_where_the_name_leads_nowhere(
        self, shell: Shell, called: Recorder, log: dict, go1: Robot
    ) -> None:
        called.replace(
            "footfall.robots.description.load_robot", lambda at: go1 if at[0] == "/" else refused()
        )
        assert shell("replay", "a.mcap").status == 0
        log["robot_digest"] = "of another"
        assert shell.refuses("replay", "a.mcap") == (
            "the log was made with robot its name of /its/folder, which is not here or has changed since:"
            " give --robot"
        )

    def test_a_policy_that_is_gone_is_told_with_the_reason(
        self, shell: Shell, called: Recorder, log: dict
    ) -> None:
        called.replace("footfall.policies.registry.load_policy", refused)
        assert shell.refuses("replay", "a.mcap") == (
            "the log was made with a policy that is not here (enough): give --policy"
        )
        assert shell.refuses("replay", "a.mcap", "--policy", "mine") == "enough"

    def test_damaged_parts_are_counted(self, shell: Shell, log: dict) -> None:
        log["result"].damaged = 3
        assert shell("replay", "a.mcap").out.startswith("7 policy steps, 3 damaged parts left out\n")
        log["result"].complete = False
        outcome = shell("replay", "a.mcap")
        assert outcome.status == 0
        assert outcome.out.startswith(
            "7 policy steps, of a run that was cut short, 3 damaged parts left out\n"
        )

    def test_a_recovered_log_says_what_it_lacks(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.deploy.recover.recover", SimpleNamespace(messages=42, damaged=3))
        outcome = shell("log", "recover", "a.mcap", "--out", "b.mcap")
        assert (outcome.status, outcome.out) == (0, "42 messages in b.mcap, 3 damaged parts left out\n")

    def test_where_it_goes_is_checked_before_a_log_is_read(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.deploy.recover.recover", SimpleNamespace(messages=1, damaged=0))
        assert "there is no folder" in shell.refuses("log", "recover", "a.mcap", "--out", "absent/b.mcap")
        assert called.names == []
        assert shell("log", "recover", "walk.log").out == "1 messages in walk.recovered.log\n"


class TestTrain:
    @pytest.fixture
    def trained(self, called: Recorder, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> SimpleNamespace:
        """All that a training calls; its run folder is `made`."""
        policy = tmp_path / "policy.onnx"
        policy.touch()
        run = SimpleNamespace(policy=policy, provenance=SimpleNamespace(robot="rex", seed=5))
        state = SimpleNamespace(main=True)

        @contextmanager
        def watched(*given: Any) -> Iterator[None]:
            called.calls.append(("watched", given, {}))
            yield

        for place, answer in (
            ("footfall.train.api.begin", Path("made")), ("footfall.train.api.resume", None),
            ("footfall.train.api.cluster.join", None),
            ("footfall.train.api.cluster.is_main_process", lambda: state.main),
            ("footfall.train.runs.folder.open_run", run), ("footfall.verbs.train.start_device", None),
            ("footfall.pages.page.check_page", None),
            ("footfall.evaluate.api.evaluate_policy", {"scenarios": {}}),
        ):  # fmt: skip
            called.replace(place, answer)
        monkeypatch.setattr("footfall.pages.beside.watched", watched)
        return state

    def test_runs_are_looked_at_where_they_are(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace
    ) -> None:
        assert shell("train", "--resume", "mine").status == 0
        assert [given for name, given, _ in called.calls if name == "open_run"] == [(Path("mine"),)] * 2
        assert called.of("evaluate_policy") == (
            ("mine", EvaluationConfig("rex", ("gentle",), 5)), {"json_path": Path("mine/evaluation.json")},
        )  # fmt: skip

    @pytest.mark.parametrize(
        ("cluster", "main", "pages"),
        [
            (("h:1", "--processes", "2", "--process", "0"), True, ["check_page", "watched"]),
            (("h:1", "--processes", "2", "--process", "1"), False, []),
            (("auto",), True, ["watched"]),
            (("auto",), False, []),
        ],
    )
    def test_of_several_processes_the_first_serves_the_page_and_evaluates(
        self,
        shell: Shell,
        called: Recorder,
        trained: SimpleNamespace,
        cluster: tuple[str, ...],
        main: bool,
        pages: list[str],
    ) -> None:
        trained.main = main
        outcome = shell("train", "--watch", "--coordinator", *cluster)
        assert outcome.status == 0, outcome.err
        assert [name for name in called.names if name in ("check_page", "watched")] == pages
        assert ("evaluate_policy" in called.names) is main
        assert outcome.out == main * (
            "watch it learn at http://localhost:8080, and afterwards with: footfall watch made\n"
        )

    def test_a_resumed_run_may_go_on_in_several_processes(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace
    ) -> None:
        assert shell("train", "--no-evaluate", "--resume", "mine", "--coordinator", "auto").status == 0
        assert called.names == ["join", "is_main_process", "resume"]

    def test_half_a_cluster_of_a_run_that_goes_on_is_half_a_cluster(
        self, shell: Shell, called: Recorder, trained: SimpleNamespace
    ) -> None:
        assert "several processes need --coordinator" in shell.refuses(
            "train", "--resume", "mine", "--process", "0"
        )
        assert called.names == []

    def test_settings_are_refused_by_the_names_that_are_typed(self, shell: Shell) -> None:
        complaint = shell.refuses("train", "--resume", "run", "--checkpoint-interval", "3")
        assert complaint == "--resume brings the run's own settings: leave --checkpoint-interval out"

    def test_the_help_names_the_defaults(self) -> None:
        assert train_verb.ROBOT_HELP.endswith("(default: go1).")
        assert train_verb.EVALUATION == "gentle"


class TestSweep:
    def point(self, **changes: Any) -> Any:
        facts = {"settings": {"ppo.clip_param": 0.2}, "mean": 2.5, "spread": 0.5, "seeds": 3, "failed": 0}
        return SimpleNamespace(**(facts | changes))

    def table(self, capsys: pytest.CaptureFixture[str], *points: Any) -> list[list[str]]:
        sweep_verb._show_points(list(points))
        return [line.split() for line in capsys.readouterr().out.splitlines()]

    def test_a_point_says_what_failed_and_what_one_seed_leaves_unknown(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        header, sound, single = self.table(
            capsys, self.point(), self.point(spread=math.nan, seeds=1, failed=2)
        )
        assert " ".join(header) == "ppo.clip_param mean result deviation between seeds seeds failed"
        assert sound == ["0.2", "2.5", "±", "0.5", "3"]
        assert single == ["0.2", "2.5", "unknown", "1", "2"]

    def test_without_a_trial_tables_are_empty(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert [" ".join(line) for line in self.table(capsys)] == [
            "mean result deviation between seeds seeds failed"
        ]
        sweep_verb._show_trials([])
        assert capsys.readouterr().out.split() == ["run", "seed", "result", "steps"]

    def test_its_folder_is_named_by_the_time_and_its_files_are_told(
        self, shell: Shell, called: Recorder, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        pytest.importorskip("ray")
        from footfall.train.sweeps.sweep import POINTS, RESULTS

        now: Callable[[Any], datetime] = lambda zone: datetime(2026, 3, 4, 5, 6, 7, tzinfo=zone)  # noqa: E731
        monkeypatch.setattr(sweep_verb, "datetime", SimpleNamespace(now=now))
        called.replace("footfall.train.sweeps.sweep.sweep", ([], [], 0))
        called.replace("footfall.train.sweeps.sweep.resume_sweep", ([], [], 0))
        made = Path("runs/sweep-20260304-050607")
        for tokens, folder in ((("space.yaml",), made), (("--resume", "mine"), Path("mine"))):
            outcome = shell("sweep", *tokens)
            assert outcome.status == 0
            assert outcome.out.endswith(f"wrote {folder / RESULTS} and {folder / POINTS}\n")
        assert called.of("sweep") == ((Path("space.yaml"), made), {})
        assert now(UTC).tzinfo is UTC


class TestDemo:
    def test_ctrl_c_ends_it_after_the_step_has_ended(self, monkeypatch: pytest.MonkeyPatch) -> None:
        waits: list[str] = []

        def wait() -> int:
            waits.append("wait")
            if len(waits) == 1:
                raise KeyboardInterrupt
            return 0

        monkeypatch.setattr(demo.subprocess, "Popen", lambda _: SimpleNamespace(wait=wait))
        with pytest.raises(KeyboardInterrupt):
            demo._step("train")
        assert waits == ["wait", "wait"]

    def test_what_it_does_by_default(self, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
        steps: list[str] = []
        monkeypatch.setattr(demo, "_step", lambda *tokens, **_: steps.append(" ".join(tokens)))
        assert shell("demo", "--out", "d").status == 0
        shared = "--robot go1 --seed 0"
        assert steps[0] == f"train {shared} --no-evaluate --preset cpu --out d/trained"
        assert f"{shared} --scenarios gentle,push --episodes 8" in steps[3]

    def test_presets_and_scenarios_are_read_for_its_robot(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.train.config.load_preset", refused)
        shell.refuses("demo", "--robot", "hexapod", "--preset", "gpu")
        (preset, robot), _ = called.of("load_preset")
        assert (preset, robot.name) == ("gpu", "hexapod")


class TestList:
    @pytest.mark.parametrize(
        ("value", "cell"),
        [
            (True, "yes"), (False, "no"), (4096, "4,096"), (10.0, "10"), (2.5, "2.5"), ("a name", "a name"),
            (["a", "b"], "a, b"), ([], ""), (None, "None"),
        ],
    )  # fmt: skip
    def test_a_cell_is_for_people(self, value: Any, cell: str) -> None:
        assert list_verb._cell(value) == cell

    def test_columns_are_what_the_rows_say(self, capsys: pytest.CaptureFixture[str]) -> None:
        rows = [{"name": "a", "total_steps": 1000}, {"name": "b", "total_steps": 5}]
        list_verb._show({"presets": rows, "robots": [{"name": "c"}]})
        lines = [line.split() for line in capsys.readouterr().out.splitlines()]
        assert lines == [
            ["presets"], ["name", "total", "steps"], ["a", "1,000"], ["b", "5"], [],
            ["robots"], ["name"], ["c"], [],
        ]  # fmt: skip

    def test_a_policy_tells_how_it_was_made(self) -> None:
        import yaml

        from footfall.policies.registry import ZOO

        for row in list_verb._policies():
            made = yaml.safe_load((ZOO / row["name"] / "run.yaml").read_text())
            assert list(row) == ["name", "robot", "preset", "trainer", "created"]
            assert {key: str(row[key]) for key in list(row)[1:]} == {
                key: str(made[key]) for key in list(row)[1:]
            }

    def test_a_controller_tells_what_it_is_and_whose(self) -> None:
        robots = [{"name": "one", "controllers": ["stand"]}, {"name": "two", "controllers": ["stand", "mpc"]}]
        rows = {row["name"]: row for row in list_verb._controllers(robots)}
        assert rows["stand"]["robots"] == ["one", "two"]
        assert rows["mpc"]["robots"] == ["two"]
        assert rows["trot"]["robots"] == []
        from footfall.policies.registry import CONTROLLERS

        assert {name: row["about"] for name, row in rows.items()} == {
            name: controller.about for name, controller in CONTROLLERS.items()
        }


class TestDiagnose:
    def test_an_exact_replay_says_no_more_than_it_has_to(self, shell: Shell, called: Recorder) -> None:
        found = SimpleNamespace(
            failure=SimpleNamespace(iteration=12, reason="nan then"), differences=[], reason="nan now",
            finding="the reward", saved=None,
        )  # fmt: skip

        def diagnose(_: Path, say: Callable[[str], None]) -> Any:
            say("iteration 11 is sound")
            return found

        called.replace("footfall.train.api.diagnose", diagnose)
        outcome = shell("diagnose", "run")
        assert outcome.out.splitlines() == [
            "iteration 11 is sound", "iteration 12 failed then: nan then",
            "iteration 12 fails now: nan now", "first: the reward",
        ]  # fmt: skip


class TestRobot:
    def test_what_a_new_robot_is_made_of_by_default(
        self, shell: Shell, called: Recorder, go1: Robot, tmp_path: Path
    ) -> None:
        from footfall.deploy.drivers.mit import RANGES

        made = SimpleNamespace(folder="there", guesses=[])
        called.replace("footfall.robots.importer.create.import_robot", made)
        called.replace("footfall.robots.description.load_robot", lambda _: go1)
        assert shell("robot", "new", "--from", "a.urdf", "--out", "mine").status == 0
        ((request,), _) = called.of("import_robot")
        assert (request.feet, request.packages) == ((), ())
        assert (request.peak_torque_nm, request.speed_rad_s, request.armature) == ({}, {}, {})
        assert request.protocols is RANGES
        assert called.of("load_robot") == ((tmp_path / "mine",), {})

    def test_figures_by_joint_may_have_spaces_between_them(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.robots.importer.create.import_robot", refused)
        shell.refuses("robot", "new", "--from", "a.urdf", "--out", "mine", "--speed", "hip=1, knee=2")
        assert called.of("import_robot")[0][0].speed_rad_s == {"hip": 1.0, "knee": 2.0}

    def test_packages_may_follow_one_another(self, shell: Shell, called: Recorder) -> None:
        called.replace("footfall.robots.importer.create.import_robot", refused)
        shell.refuses("robot", "new", "--from", "a.urdf", "--out", "mine", "--packages", "p", "q")
        assert called.of("import_robot")[0][0].packages == (Path("p"), Path("q"))
