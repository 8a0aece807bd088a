"""What an evaluation is asked for arrives where it acts: tasks, episodes, figures and JSON.

No episode is run here: the simulation is stood in for, and options all differ from their defaults.
"""

import io
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
from outcomes import GOOD, outcome
from rich.console import Console
from traces import walk

from footfall.common.errors import UserError
from footfall.domain_rand.noise import Noise
from footfall.evaluate import api, episodes, suite
from footfall.evaluate.comparison import Comparison, PolicyResult, command_line
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.episodes import EpisodeTask, run_with
from footfall.evaluate.metrics import score
from footfall.evaluate.plan import CommandSchedule, EpisodePlan, plan_episodes, spread_levels
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.scenarios import DrawnCommands, Scenario, ScenarioFile, Waypoint
from footfall.evaluate.suite import CourseWalk
from footfall.evaluate.table import print_results, scenario_table, warnings
from footfall.plant.episode import Push
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot

OWN_NOISE = Noise(gyro=0.123)
FILE = ScenarioFile(
    OWN_NOISE,
    {
        "one": Scenario("One", 3, 2.0, script=(Waypoint(0.0),), levels={"friction": (0.3, 0.9)}),
        "two": Scenario("Two", 2, 3.0, script=(Waypoint(0.0),)),
        "course": Scenario("A walk", 5, 4.0, script=(Waypoint(0.0),)),
    },
)
PLANT = Path("other.xml")
OWN = Path("own.yaml")
TWO = EvaluationConfig("go1", ("two",))
CONFIG = EvaluationConfig("go1", ("two", "one"), seed=7, plant=PLANT, ground_truth=True, workers=3)


class TestSuite:
    @pytest.fixture
    def asked(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """Tasks and workers of each call; a task's distance tells its policy, its index and its scenario."""
        calls: list[Any] = []

        def run_all(
            function: Any, tasks: Sequence[EpisodeTask], workers: Any, done: Any = None
        ) -> list[TaskResult]:
            assert function is suite.run_task
            calls.append((list(tasks), workers))
            for finished in range(1, len(tasks) + 1 if done else 0):
                done(finished)
            return [
                outcome(
                    replace(GOOD, peak_torque_nm=self.mark(task.policy, task.plan)),
                    compute_ms=np.array([1.0, 9.0]), period_ms=5.0, trace=f"trace of {task.policy}",
                )
                for task in tasks
            ]  # fmt: skip

        monkeypatch.setattr(suite, "run_all", run_all)
        return calls

    def mark(self, policy: str, plan: EpisodePlan) -> float:
        return (
            100.0 * ("ab".index(policy) + 1)
            + 10.0 * ["one", "two", "course"].index(plan.scenario)
            + plan.index
        )

    def test_each_policy_meets_every_episode_and_its_figures_are_its_own(self, asked: list[Any]) -> None:
        progress: list[tuple[int, int]] = []
        figures = suite.run_suite(["b", "a"], CONFIG, FILE, lambda *each: progress.append(each))
        ((tasks, workers),) = asked
        assert (workers, progress) == (3, [(k, 10) for k in range(1, 11)])
        plans = {name: plan_episodes(name, FILE.scenarios[name], 7) for name in ("one", "two")}
        for policy in ("a", "b"):
            own = [task.plan for task in tasks if task.policy == policy]
            assert own == [*plans["two"], *plans["one"]]
            assert list(figures[policy]) == ["two", "one"]
            assert figures[policy]["one"]["episodes"] == 3
            assert figures[policy]["one"]["peak_torque_nm"] == self.mark(policy, plans["one"][2])
            assert figures[policy]["two"]["peak_torque_nm"] == self.mark(policy, plans["two"][1])
        for task in tasks:
            assert (task.robot, task.noise, task.plant) == ("go1", OWN_NOISE, PLANT)
            assert task.ground_truth
            assert not task.keep_trace

    def test_fewer_episodes_are_run_where_fewer_are_asked_for(self, asked: list[Any]) -> None:
        suite.run_suite(["a"], replace(CONFIG, episodes=1), FILE)
        assert [task.plan.scenario for task in asked[0][0]] == ["two", "one"]

    def test_the_bootstrap_has_the_suites_seed(
        self, asked: list[Any], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        seeds: list[int] = []
        monkeypatch.setattr(suite, "summarise", lambda _, __, seed: seeds.append(seed))
        suite.run_suite(["a"], CONFIG, FILE)
        assert seeds == [7, 7]

    def test_the_course_is_walked_once_by_each_and_recorded(self, asked: list[Any]) -> None:
        walks = suite.run_course(["b", "a"], CONFIG, FILE)
        ((tasks, workers),) = asked
        (plan,) = plan_episodes("course", FILE.scenarios["course"], 7, 1)
        assert workers == 1
        assert [(task.policy, task.plan, task.keep_trace) for task in tasks] == [
            ("b", plan, True),
            ("a", plan, True),
        ]
        assert all((task.noise, task.plant, task.ground_truth) == (OWN_NOISE, PLANT, True) for task in tasks)
        compute = {"compute_ms": {"p50": 5.0, "p99": pytest.approx(8.92)}, "missed_deadlines": 0.5}
        assert walks == {name: CourseWalk(plan, f"trace of {name}", compute, "") for name in ("b", "a")}

    def test_a_walk_that_failed_says_why(self) -> None:
        failed = suite._course_walk("plan", TaskResult(None, "its process died"))  # type: ignore[arg-type]
        nothing = {"compute_ms": {"p50": None, "p99": None}, "missed_deadlines": None}
        assert failed == CourseWalk("plan", None, nothing, "its process died")  # type: ignore[arg-type]


class TestEpisode:
    PLAN = EpisodePlan(
        "own", 4, 11, 2.5, CommandSchedule((0.0,), ((0.5, 0.0, 0.0),)), (Push(1.0, (0.0, 0.3, 0.0)),),
        {"payload_kg": 2.0, "friction": 0.3}, False,
    )  # fmt: skip

    @pytest.fixture
    def ran(self, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """What the simulation was called with; it hands back `trace`."""
        seen = SimpleNamespace(trace=replace(walk(), compute_ms=np.array([0.1, 0.7]), notes=("no floor",)))

        def run_episode(*given: Any) -> Any:
            seen.given = given
            return seen.trace

        monkeypatch.setattr(episodes, "run_episode", run_episode)
        return seen

    def task(self, **changes: Any) -> EpisodeTask:
        return replace(EpisodeTask("stand", "go1", self.PLAN, OWN_NOISE), **changes)

    def test_all_of_a_task_reaches_the_episode(self, ran: SimpleNamespace, go1: Robot) -> None:
        policy = load_policy("stand", go1)
        found = run_with(policy, self.task(plant=go1.xml_path, ground_truth=True, keep_trace=True))
        robot, acting, episode = ran.given
        assert (robot.name, acting) == ("go1", policy)
        assert (episode.command_source, episode.duration_s, episode.seed) == (self.PLAN.schedule, 2.5, 11)
        assert (episode.plant, episode.noise, episode.pushes) == (go1.xml_path, OWN_NOISE, self.PLAN.pushes)
        assert episode.ground_truth
        assert {name: float(value) for name, value in episode.sample.items()} == self.PLAN.levels
        assert found.levels == self.PLAN.levels
        assert (found.period_ms, found.notes, found.trace) == (2.0, ("no floor",), ran.trace)
        assert found.compute_ms.tolist() == pytest.approx([0.1, 0.7])
        assert found.compute_ms.dtype == np.float32
        weight_n = found.metrics.weight_n
        assert found.metrics == replace(
            score(ran.trace, go1, weight_n), estimate_mse=found.metrics.estimate_mse
        )

    def test_a_load_on_its_back_is_part_of_its_weight(self, ran: SimpleNamespace, go1: Robot) -> None:
        """2 kg, at the gravity of the robot's own model."""
        own = mujoco.MjModel.from_xml_path(str(go1.xml_path)).body_mass.sum()
        plain = replace(self.PLAN, levels={"friction": 0.3})
        weights = [
            run_with(load_policy("stand", go1), self.task(plan=plan)).metrics.weight_n
            for plan in (plain, self.PLAN)
        ]
        assert weights == pytest.approx([9.81 * own, 9.81 * (own + 2.0)])

    def test_what_is_drawn_is_drawn_for_its_joints_and_its_bodies_the_world_left_out(
        self, ran: SimpleNamespace, go1: Robot
    ) -> None:
        run_with(load_policy("stand", go1), self.task(plan=replace(self.PLAN, randomised=True)))
        own = mujoco.MjModel.from_xml_path(str(go1.xml_path))
        assert {np.shape(value) for value in ran.given[2].sample.values()} >= {(12,), (own.nbody - 1,)}
        assert all(
            len(np.shape(v)) < 1 or len(v) in (3, 12, own.nbody - 1) for v in ran.given[2].sample.values()
        )

    def test_what_is_not_asked_for_is_not_there(self, ran: SimpleNamespace, go1: Robot) -> None:
        plain = replace(self.PLAN, levels={}, pushes=())
        found = run_with(load_policy("stand", go1), self.task(plan=plain))
        episode = ran.given[2]
        assert (episode.plant, episode.sample, episode.pushes, episode.ground_truth) == (
            None,
            None,
            (),
            False,
        )
        assert found.trace is None

    def test_trouble_is_each_reason_once_the_fall_first(self, ran: SimpleNamespace, go1: Robot) -> None:
        faults = ("motor 3 is hot", "it tilted", "motor 3 is hot")
        ran.trace = replace(ran.trace, fell=True, fall_reason="it tilted", faults=faults)
        assert run_with(load_policy("stand", go1), self.task()).trouble == "it tilted; motor 3 is hot"
        ran.trace = replace(ran.trace, fall_reason="", faults=())
        assert run_with(load_policy("stand", go1), self.task()).trouble == ""

    def test_a_task_is_run_with_the_policy_that_it_names(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(episodes, "run_with", lambda policy, task: (policy.name, task))
        for name in ("stand", "trot"):
            assert episodes.run_task(self.task(policy=name)) == (name, self.task(policy=name))


def bare(name: str, episodes: int = 4) -> dict[str, Any]:
    """A scenario's summary of `episodes` falls out of 24."""
    return {"episodes": 24, "failed_episodes": [], "falls": episodes, "fall_rate": episodes / 24,
            "fall_rate_interval": [0.1, 0.2], "notes": [], "about": name}  # fmt: skip


class TestApi:
    @pytest.fixture
    def ran(self, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """What the suite and the course were called with."""
        seen = SimpleNamespace(order=[])

        def run_suite(
            policies: Any, config: EvaluationConfig, file: ScenarioFile, done: Any
        ) -> dict[str, Any]:
            seen.suite, seen.done = (policies, config, file), done
            seen.order.append("suite")
            return {spec: {name: bare(f"{spec} {name}") for name in config.scenarios} for spec in policies}

        def run_course(policies: Any, config: EvaluationConfig, file: ScenarioFile) -> dict[str, Any]:
            seen.course = (policies, config, file)
            seen.order.append("course")
            times = {spec: {"p50": 1.0 + number, "p99": 3.0} for number, spec in enumerate(policies)}
            return {
                spec: CourseWalk(
                    "plan", f"trace of {spec}", {"compute_ms": times[spec], "missed_deadlines": 0.5}, ""
                )  # type: ignore[arg-type]
                for spec in policies
            }

        def load_scenarios(robot: Robot, own: Path | None) -> ScenarioFile:
            assert robot.description.name == "go1"
            seen.own = own
            return FILE

        monkeypatch.setattr(api, "load_scenarios", load_scenarios)
        monkeypatch.setattr(api, "run_suite", run_suite)
        monkeypatch.setattr(api, "run_course", run_course)
        return seen

    @pytest.fixture
    def console(self) -> Console:
        return Console(file=io.StringIO(), width=200)

    def test_every_argument_of_evaluate_reaches_the_suite_and_the_json(
        self, ran: SimpleNamespace, go1: Robot, tmp_path: Path, console: Console
    ) -> None:
        path = tmp_path / "out.json"
        config = EvaluationConfig("go1", ("two", "one"), 7, 5, go1.xml_path, True, 3, OWN)
        result = api.evaluate_policy("trot", config, json_path=path, console=console)
        assert ran.suite == (["trot"], config, FILE)
        assert ran.order == ["suite"]
        assert ran.own == OWN
        assert json.loads(path.read_text()) == result
        assert list(result["scenarios"]) == ["two", "one"]
        assert result["scenarios"]["one"] == bare("trot one")
        shared = {key: result[key] for key in ("policy", "robot", "seed", "ground_truth", "plant", "about")}
        about = "hand-written controller, 500 Hz, on estimated velocity"
        assert shared == {
            "policy": "trot", "robot": "go1", "seed": 7, "ground_truth": True, "plant": str(go1.xml_path),
            "about": shared["about"],
        }  # fmt: skip
        assert shared["about"].startswith(about.split(",", maxsplit=1)[0])
        assert set(result["versions"]) >= {"footfall", "mujoco"}
        assert "cores" in result["machine"]
        printed = console.file.getvalue()  # type: ignore[attr-defined]
        assert printed.index("two") < printed.index("one") < printed.index("Over 24 episodes")

    def test_compare_hands_the_same_setup_to_both_and_joins_what_they_found(
        self,
        ran: SimpleNamespace,
        go1: Robot,
        tmp_path: Path,
        console: Console,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        seen: list[Any] = []
        monkeypatch.setattr("footfall.evaluate.report.films.films_of", lambda of: seen.append(of) or "films")
        monkeypatch.setattr(
            "footfall.evaluate.report.page.render", lambda of, films: f"{films} of {seen[0] is of}"
        )
        json_path, html_path = tmp_path / "out.json", tmp_path / "out.html"
        config = EvaluationConfig("go1", ("two",), 7, 5, go1.xml_path, True, 3, OWN)
        results = api.compare_policies(
            ["trot", "stand"], config, json_path=json_path, html_path=html_path, console=console
        )
        assert ran.suite == ran.course == (["trot", "stand"], config, FILE)
        assert ran.order == ["suite", "course"]
        assert html_path.read_text() == "films of True"
        assert json.loads(json_path.read_text()) == results
        assert [(each["policy"], each["compute_ms"]["p50"]) for each in results.values()] == [
            ("trot", 1.0), ("stand", 2.0),
        ]  # fmt: skip
        assert list(results) == ["trot", "stand"]
        (of,) = seen
        assert (of.robot.name, of.config, of.file) == ("go1", config, FILE)
        assert [(each.name, each.spec, each.course.trace) for each in of.policies] == [
            ("trot", "trot", "trace of trot"), ("stand", "stand", "trace of stand"),
        ]  # fmt: skip
        rates = [load_policy(name, go1).rate_hz for name in ("trot", "stand")]
        assert [each.period_ms for each in of.policies] == [1e3 / rate for rate in rates]
        assert of.policies[1].origin == "hand-written controller, 500 Hz"
        assert of.policies[1].result == results["stand"]
        assert set(of.versions) >= {"footfall", "mujoco"}
        assert f"report: {html_path}" in console.file.getvalue()  # type: ignore[attr-defined]

    def test_without_a_report_nothing_is_filmed(
        self, ran: SimpleNamespace, console: Console, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("footfall.evaluate.report.films.films_of", lambda _: pytest.fail("it filmed"))
        assert list(api.compare_policies(["stand"], TWO, console=console)) == ["stand"]

    def test_a_report_is_a_file(self, ran: SimpleNamespace, console: Console) -> None:
        with pytest.raises(UserError, match="cannot write the report to /dev/null: give a file name"):
            api.compare_policies(["stand"], TWO, html_path=Path("/dev/null"), console=console)
        assert ran.order == []

    def test_a_policy_named_twice_is_refused(self, ran: SimpleNamespace, console: Console) -> None:
        with pytest.raises(UserError, match="'stand' is named twice"):
            api.compare_policies(["stand", "trot", "stand"], TWO, console=console)

    @pytest.mark.parametrize(
        ("changes", "complaint"),
        [
            ({"specs": []}, "name at least one policy"),
            ({"episodes": 0}, "episodes is 0: it must be 1 or more"),
            ({"scenarios": ("two", "ballet")}, "no scenario 'ballet'"),
            ({"specs": ["stand", "dance"]}, "no policy 'dance'"),
            ({"specs": ["dance"]}, "no policy 'dance'"),
            ({"robot": "r2d2"}, "no robot 'r2d2'"),
            ({"plant": Path("absent.xml")}, "no MJCF file at absent.xml"),
            ({"json_path": Path("absent/out.json")}, "there is no folder .*absent"),
            ({"html_path": Path("absent/out.html")}, "there is no folder .*absent"),
            ({"json_path": Path("out"), "html_path": Path("out")}, "a name of its own"),
        ],
    )
    def test_what_cannot_be_is_known_before_the_first_episode(
        self,
        ran: SimpleNamespace,
        console: Console,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        changes: dict[str, Any],
        complaint: str,
    ) -> None:
        monkeypatch.chdir(tmp_path)
        outputs = {"json_path", "html_path"}
        specs = changes.pop("specs", ["stand"])
        config = replace(TWO, **{key: value for key, value in changes.items() if key not in outputs})
        asked: Any = {key: value for key, value in changes.items() if key in outputs} | {"console": console}
        with pytest.raises(UserError, match=complaint):
            api.compare_policies(specs, config, **asked)
        if len(specs) == 1 and "html_path" not in changes:
            with pytest.raises(UserError, match=complaint):
                api.evaluate_policy(*specs, config, **asked)
        assert ran.order == []

    def test_without_the_extra_no_report_is_begun(
        self, ran: SimpleNamespace, console: Console, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("footfall.evaluate.report.extra.find_spec", lambda _: None)
        with pytest.raises(UserError, match="an HTML report needs jinja2, matplotlib"):
            api.compare_policies(["stand"], TWO, html_path=tmp_path / "x.html", console=console)
        assert ran.order == []

    def test_names_are_the_policies_own_where_they_differ(self) -> None:
        policies: Any = {
            spec: SimpleNamespace(name=name) for spec, name in zip("abc", ("x", "y", "x"), strict=True)
        }
        assert api.policy_names(policies) == {"a": "a", "b": "y", "c": "c"}
        odd: Any = {"spec": SimpleNamespace(name="caf\udce9")}
        assert api.policy_names(odd) == {"spec": "caf?"}

    def test_progress_is_of_all_episodes(self) -> None:
        console = Console(file=io.StringIO(), force_terminal=True, width=100)
        with api._progress(console) as done:
            done(3, 8)
        assert "3/8" in console.file.getvalue()  # type: ignore[attr-defined]
        piped = Console(file=io.StringIO(), width=100)
        with api._progress(piped) as done:
            done(3, 8)
        assert piped.file.getvalue() == ""  # type: ignore[attr-defined]


class TestPlans:
    """Scenarios as they are scripted, drawn and spread over levels."""

    def test_a_script_is_followed_and_levels_stand_in_for_its_axes(self) -> None:
        script = (Waypoint(0.0, 0.1, 0.2, 0.3), Waypoint(1.5, -0.4, -0.5, -0.6))
        scenario = Scenario("x", 2, 4.0, script=script, levels={"leftward_m_s": (0.9,)})
        (plan, _) = plan_episodes("x", scenario, 0)
        assert plan.schedule == CommandSchedule((0.0, 1.5), ((0.1, 0.9, 0.3), (-0.4, 0.9, -0.6)))
        assert (plan.scenario, plan.index, plan.duration_s, plan.randomised) == ("x", 0, 4.0, False)
        assert plan.pushes == ()

    def test_drawn_commands_are_each_in_its_own_range_for_a_time_in_its_own(self) -> None:
        drawn = DrawnCommands((0.1, 0.2), (0.3, 0.4), (0.5, 0.6), (0.7, 0.9), standing_share=0.25)
        plans = plan_episodes("x", Scenario("x", 40, 10.0, commands=drawn, randomised=True), 0)
        commands = np.array([command for plan in plans for command in plan.schedule.commands])
        stands = ~commands.any(axis=1)
        assert stands.mean() == pytest.approx(0.25, abs=0.07)
        low, high = commands[~stands].min(axis=0), commands[~stands].max(axis=0)
        assert low == pytest.approx([0.1, 0.3, 0.5], abs=0.01)
        assert high == pytest.approx([0.2, 0.4, 0.6], abs=0.01)
        held = np.concatenate([np.diff(plan.schedule.from_s) for plan in plans])
        assert (held.min(), held.max()) == pytest.approx((0.7, 0.9), abs=0.01)
        assert all(9.1 <= plan.schedule.from_s[-1] < 10.0 for plan in plans)
        assert all(plan.randomised for plan in plans)
        assert [plan.index for plan in plans] == list(range(40))

    def test_nobody_is_asked_to_stand_unless_that_is_said(self) -> None:
        drawn = DrawnCommands((0.1, 0.2), (0.3, 0.4), (0.5, 0.6), (0.1, 0.2))
        for plan in plan_episodes("x", Scenario("x", 5, 10.0, commands=drawn), 0):
            assert all(all(command) for command in plan.schedule.commands)

    def test_pushes_come_within_their_time_and_straight_ahead_unless_a_direction_is_given(self) -> None:
        scenario = Scenario("x", 50, 5.0, levels={"push_m_s": (0.5, 2.0)}, push_between_s=(1.25, 1.75))
        plans = plan_episodes("x", scenario, 0)
        times = [plan.pushes[0].time_s for plan in plans]
        assert (min(times), max(times)) == pytest.approx((1.25, 1.75), abs=0.05)
        for plan in plans:
            assert plan.pushes[0].delta_v_m_s == pytest.approx((plan.levels["push_m_s"], 0.0, 0.0))
        assert plan_episodes("x", replace(scenario, levels={"friction": (0.5,)}), 0)[0].pushes == ()

    def test_levels_meet_every_combination_before_one_comes_twice(self) -> None:
        levels = {"friction": (0.2, 0.4, 0.6), "payload_kg": (0.0, 1.0), "forward_m_s": (0.3, 0.5)}
        chosen = spread_levels(levels, 24, np.random.default_rng(1))
        assert [list(each) for each in chosen] == [list(levels)] * 24
        met = [tuple(each.values()) for each in chosen]
        assert len(set(met[:12])) == 12
        assert met[12:] == met[:12]
        orders = [[each[1:] for each in met[:12] if each[0] == friction] for friction in levels["friction"]]
        assert not orders[0] == orders[1] == orders[2]  # each has an order of its own
        assert spread_levels({}, 3, np.random.default_rng(0)) == [{}, {}, {}]

    def test_which_level_comes_first_is_drawn(self) -> None:
        """Or the first few episodes would always meet the mildest ones."""
        firsts = [
            spread_levels({"friction": (0.2, 0.4, 0.6)}, 1, np.random.default_rng(seed))[0]["friction"]
            for seed in range(20)
        ]
        assert set(firsts) == {0.2, 0.4, 0.6}


class TestComparison:
    """What a report says of how it came about."""

    def compared(
        self, config: EvaluationConfig, file: ScenarioFile = FILE, specs: Sequence[str] = ("b", "a")
    ) -> Any:
        policies = [
            PolicyResult(f"{spec}'s name", spec, "", 2.0, {"scenarios": {"one": spec}}, None)  # type: ignore[arg-type]
            for spec in specs
        ]
        return Comparison(None, config, file, policies, {})  # type: ignore[arg-type]

    def test_what_to_type_for_the_same_figures(self) -> None:
        plain = "footfall compare b a --robot go1 --scenarios one --seed 0 --html report.html"
        assert command_line(self.compared(EvaluationConfig("go1", ("one",)))) == plain
        config = EvaluationConfig("my robot", ("two", "one"), 7, 5, Path("a b.xml"), True, 3, OWN)
        assert command_line(self.compared(config, specs=["runs/it's mine"])) == (
            "footfall compare 'runs/it'\"'\"'s mine' --robot 'my robot' --scenarios two,one --seed 7"
            " --episodes 5 --scenario-file own.yaml --plant 'a b.xml' --ground-truth --html report.html"
        )

    def test_pushes_are_those_of_the_first_scenario_that_varies_their_size(self) -> None:
        def pushing(*levels: str) -> Scenario:
            return Scenario("x", 1, 2.0, levels=dict.fromkeys(levels, (1.0,)), push_between_s=(0.0, 1.0))

        scenarios = FILE.scenarios | {
            "where": pushing("push_direction_deg"), "late": pushing("push_m_s"), "later": pushing("push_m_s"),
        }  # fmt: skip
        file = ScenarioFile(OWN_NOISE, scenarios)
        chosen = EvaluationConfig("go1", ("one", "where", "late", "later"))
        assert self.compared(chosen, file).push_scenario == "late"
        assert self.compared(EvaluationConfig("go1", ("one", "where")), file).push_scenario is None

    def test_summaries_are_by_name_in_the_order_of_the_policies(self) -> None:
        found = self.compared(EvaluationConfig("go1", ("one",))).summaries("one")
        assert list(found.items()) == [("b's name", "b"), ("a's name", "a")]


def test_brackets_in_a_name_are_no_markup() -> None:
    console = Console(file=io.StringIO(), width=200)
    print_results({"[bold]mine": {"scenarios": {"one": bare("x")}}}, console)
    printed = console.file.getvalue()  # type: ignore[attr-defined]
    assert printed.count("[bold]mine") == 2  # over its column and in the verdict


class TestTable:
    def cells(self, *summaries: dict[str, Any]) -> dict[str, list[Any]]:
        names = [f"p{k}" for k in range(len(summaries))]
        table = scenario_table("nominal", names, list(summaries))
        assert table.title == "nominal"
        assert [str(column.header) for column in table.columns] == ["", *names]
        rows = zip(*(column.cells for column in table.columns), strict=True)
        return {str(label): list(cells) for label, *cells in rows}

    def test_each_policy_has_its_number_interval_and_the_best_is_green(self) -> None:
        good = bare("a", 0) | {
            "fall_rate_interval": [0.0, 0.05], "lin_vel_rmse": 0.2, "lin_vel_rmse_interval": [0.1, 0.3],
            "peak_torque_nm": 12.34,
        }  # fmt: skip
        bad = bare("b", 12) | {
            "fall_rate_interval": [0.3, 0.7],
            "lin_vel_rmse": 0.25,
            "lin_vel_rmse_interval": [0.2, 0.4],
        }
        cells = self.cells(bad, good)
        assert [cell.plain for cell in cells["Falls"]] == ["12 of 24\n30 to 70 %", "0 of 24\n0 to 5 %"]
        assert [str(cell.style) for cell in cells["Falls"]] == ["", "bold green"]
        assert [cell.plain for cell in cells["Velocity error (m/s)"]] == [
            "0.250\n0.200 to 0.400", "0.200\n0.100 to 0.300",
        ]  # fmt: skip
        assert [str(cell.style) for cell in cells["Velocity error (m/s)"]] == ["", ""]
        assert [cell.plain for cell in cells["Peak torque (N m)"]] == ["–", "12.3"]
        assert list(cells) == ["Falls", "Velocity error (m/s)", "Peak torque (N m)"]

    def test_failed_episodes_are_told_by_policy_and_scenario_before_the_notes(self) -> None:
        failed = bare("a") | {"failed_episodes": ["episode 3: no"], "notes": ["no floor"]}
        results = {
            "mine": {"scenarios": {"one": bare("x"), "two": failed}},
            "trot": {"scenarios": {"one": failed}},
        }
        assert warnings(results) == [
            "mine, two: 1 of 25 episodes failed: no (1)", "trot, one: 1 of 25 episodes failed: no (1)",
            "no floor",
        ]  # fmt: skip


class TestScore:
    """A trace whose numbers all differ, against plain sums."""

    def test_every_score_is_of_its_own_signal(self, go1: Robot) -> None:
        rng = np.random.default_rng(3)
        count, rate_hz = 700, 50.0
        draws: dict[str, Any] = {
            "command": np.repeat(rng.normal(size=(2, 3)), [300, 400], axis=0),
            "base_velocity": rng.normal(size=(count, 3)),
            "base_angular_velocity": rng.normal(size=(count, 3)),
            "motor_torque": rng.normal(size=(count, 12)) * np.arange(1, 13),
            "joint_target": rng.normal(size=(count, 12)), "foot_velocity": rng.normal(size=(count, 4, 3)),
            "foot_contact": rng.random((count, 4)) < [0.2, 0.4, 0.6, 0.8],
            "estimated_velocity": rng.normal(size=(count, 3)), "electrical_power": rng.random(count),
            "mechanical_power": rng.random(count), "positive_power": rng.random(count),
            "base_position": np.outer(np.arange(count), [0.02, -0.015, 0.3]),
        }  # fmt: skip
        trace = replace(walk(7.0), time_s=np.arange(count) / rate_hz, record_rate_hz=rate_hz, **draws)
        found = score(trace, go1, 77.0)
        settled = np.r_[50:300, 350:700]
        assert found.scored_s == pytest.approx(600 / rate_hz)
        assert found.walked_s == pytest.approx(14.0)
        command, linear, angular = (
            draws[n][settled] for n in ("command", "base_velocity", "base_angular_velocity")
        )
        assert found.lin_vel_mse == pytest.approx(np.mean(np.sum((command - linear)[:, :2] ** 2, axis=1)))
        assert found.yaw_rate_mse == pytest.approx(np.mean((command[:, 2] - angular[:, 2]) ** 2))
        assert found.mean_velocity == pytest.approx([*linear[:, :2].mean(axis=0), angular[:, 2].mean()])
        off = draws["estimated_velocity"][settled, :2] - linear[:, :2]
        assert found.estimate_mse == pytest.approx(np.mean(np.sum(off**2, axis=1)))
        energies = (found.electrical_j, found.mechanical_j, found.positive_j)
        powers = ("electrical_power", "mechanical_power", "positive_power")
        assert energies == pytest.approx([draws[name].sum() / rate_hz for name in powers])
        assert found.weight_n == 77.0
        torque = np.abs(draws["motor_torque"])
        assert found.peak_torque_nm == pytest.approx(torque.max())
        assert found.peak_torque_share == pytest.approx((torque.max(axis=0) / go1.motor.peak_torque).max())
        assert found.stance_s == pytest.approx(draws["foot_contact"].sum() / rate_hz)
        speeds = np.hypot(draws["foot_velocity"][..., 0], draws["foot_velocity"][..., 1])
        assert found.foot_slip_m_s == pytest.approx(speeds[draws["foot_contact"]].mean())
        for name, rate in (
            ("joint_target", found.target_rate_rad_s),
            ("motor_torque", found.torque_rate_nm_s),
        ):
            assert rate == pytest.approx(np.sqrt(np.mean((np.diff(draws[name], axis=0) * rate_hz) ** 2)))
        assert found.distance_m == pytest.approx(699 * 0.025, rel=0.05)
