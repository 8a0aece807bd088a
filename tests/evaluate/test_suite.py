"""Requests, tasks, names, origins and the command of an evaluation. No episode is run here."""

import io
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from outcomes import GOOD, outcome
from rich.console import Console

from footfall import EvaluationConfig, Robot, UserError, load_policy
from footfall.domain_rand.noise import Noise
from footfall.evaluate import api, suite
from footfall.evaluate.comparison import Comparison, PolicyResult, command_line
from footfall.evaluate.plan import EpisodePlan, plan_episodes
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.provenance import policy_description
from footfall.evaluate.scenarios import Scenario, ScenarioFile, Waypoint
from footfall.evaluate.suite import CourseWalk
from footfall.evaluate.table import print_results
from footfall.policies.contract import Contract
from footfall.terrain.declaration import GroundConfig

PLANT = Path("other.xml")
OWN_NOISE = Noise(gyro=0.123)
ONE = Scenario("One", 3, 2.0, script=(Waypoint(0.0),), levels={"friction": (0.3, 0.9)})
TWO = Scenario("Two", 2, 3.0, script=(Waypoint(0.0),))
COURSE = Scenario("A walk", 5, 4.0, script=(Waypoint(0.0),))
FILE = ScenarioFile(OWN_NOISE, {"one": ONE, "two": TWO, "course": COURSE})
CONFIG = EvaluationConfig("go1", ("two", "one"), seed=7, plant=PLANT, ground_truth=True, workers=3)


class TestSuite:
    @pytest.fixture
    def calls(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """Tasks and workers of each call; a task's torque encodes its policy, index and scenario."""
        calls: list[Any] = []

        def run_all(function: Any, tasks: Any, workers: Any, on_finished: Any = None) -> list[TaskResult]:
            assert function is suite.run_task
            calls.append((list(tasks), workers))
            for finished in range(1, len(tasks) + 1 if on_finished else 0):
                on_finished(finished)
            timing = {"compute_ms": np.array([1.0, 9.0]), "period_ms": 5.0}
            marked = [replace(GOOD, peak_torque_nm=self.mark(task.policy, task.plan)) for task in tasks]
            return [
                outcome(metrics, trace=f"trace of {task.policy}", **timing)
                for metrics, task in zip(marked, tasks, strict=True)
            ]

        monkeypatch.setattr(suite, "run_all", run_all)
        return calls

    def mark(self, policy: str, plan: EpisodePlan) -> float:
        scenario = ["one", "two", "course", "stairs"].index(plan.scenario)
        return 100.0 * ("ab".index(policy) + 1) + 10.0 * scenario + plan.index

    def test_each_policy_runs_every_episode_and_has_its_own_figures(self, calls: list[Any]) -> None:
        progress: list[tuple[int, int]] = []
        figures = suite.run_suite(["b", "a"], CONFIG, FILE, lambda *each: progress.append(each))
        ((tasks, workers),) = calls
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
            assert (task.ground_truth, task.keep_trace) == (True, False)

    def test_the_course_is_walked_once_by_each_and_recorded(self, calls: list[Any]) -> None:
        walks = suite.run_course(["b", "a"], CONFIG, FILE)
        ((tasks, workers),) = calls
        (plan,) = plan_episodes("course", FILE.scenarios["course"], 7, 1)
        assert workers == 1
        recorded = [(task.policy, task.plan, task.keep_trace) for task in tasks]
        assert recorded == [("b", plan, True), ("a", plan, True)]
        assert all((task.noise, task.plant, task.ground_truth) == (OWN_NOISE, PLANT, True) for task in tasks)
        compute = {"compute_ms": {"p50": 5.0, "p99": pytest.approx(8.92)}, "missed_deadlines": 0.5}
        assert walks == {name: CourseWalk(plan, f"trace of {name}", compute, "") for name in ("b", "a")}

    def test_the_highest_level_of_each_ground_is_recorded(self, calls: list[Any]) -> None:
        levels = {"step_m": (0.05, 0.2, -0.3, 0.1)}
        stairs = Scenario("Stairs", 4, 1.0, ground=GroundConfig("stairs"), levels=levels)
        file = replace(FILE, scenarios={**FILE.scenarios, "stairs": stairs})
        walks = suite.run_grounds(["b", "a"], replace(CONFIG, scenarios=("two", "stairs")), file)
        ((tasks, _),) = calls
        highest = {"step_m": 0.2}
        recorded = [(task.policy, task.plan.levels, task.keep_trace) for task in tasks]
        assert recorded == [("b", highest, True), ("a", highest, True)]
        assert {name: list(by) for name, by in walks.items()} == {"b": ["stairs"], "a": ["stairs"]}
        assert walks["a"]["stairs"].trace == "trace of a"


def test_impossible_requests_are_refused_before_the_first_episode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(api, "load_scenarios", lambda *_: FILE)
    monkeypatch.setattr(api, "run_suite", lambda *_: pytest.fail("an episode has begun"))
    rows: list[tuple[Sequence[str], dict[str, Any], dict[str, Path], str]] = [
        ([], {}, {}, "policy"), (["stand"], {"episodes": 0}, {}, "episodes is 0"),
        ("stand", {}, {}, r"\['stand'\]"), (["stand"], {"seed": -1}, {}, "seed is -1"),
        (["stand"], {"scenarios": ("two", "ballet")}, {}, "'ballet'"),
        (["stand", "dance"], {}, {}, "'dance'"), (["dance"], {}, {}, "'dance'"),
        (["stand"], {"robot": "r2d2"}, {}, "'r2d2'"),
        (["stand"], {"plant": Path("absent.xml")}, {}, "absent.xml"),
        (["stand"], {}, {"json_path": Path("absent/out.json")}, "absent"),
        (["stand"], {}, {"html_path": Path("absent/out.html")}, "absent"),
        (["stand"], {}, {"html_path": Path("/dev/null")}, "/dev/null"),
        (["stand"], {}, {"json_path": Path("out"), "html_path": Path("out")}, "out"),
    ]  # fmt: skip
    for specs, settings, outputs, complaint in rows:
        config, quiet = replace(EvaluationConfig("go1", ("two",)), **settings), Console(quiet=True)
        with pytest.raises(UserError, match=complaint):
            api.compare_policies(specs, config, **outputs, console=quiet)
        if len(specs) == 1 and "html_path" not in outputs:
            with pytest.raises(UserError, match=complaint):
                api.evaluate_policy(*specs, config, **outputs, console=quiet)


def test_names_are_the_policies_own_where_they_differ() -> None:
    names = {"a": "x", "b": "y", "c": "x", "d": "caf\udce9"}
    policies: Any = {spec: SimpleNamespace(name=name) for spec, name in names.items()}
    assert api.policy_names(policies) == {"a": "a", "b": "y", "c": "c", "d": "caf?"}


def test_the_command_for_the_same_figures_is_shown() -> None:
    def command(config: EvaluationConfig, *specs: str) -> str:
        policies: Any = [PolicyResult(spec, spec, "", 2.0, {}, None) for spec in specs]  # type: ignore[arg-type]
        return command_line(Comparison(None, config, FILE, policies, {}))  # type: ignore[arg-type]

    plain = "footfall compare b a --robot go1 --scenarios one --seed 0 --html report.html"
    assert command(EvaluationConfig("go1", ("one",)), "b", "a") == plain
    config = EvaluationConfig("my robot", ("two", "one"), 7, 5, Path("a b.xml"), True, 3, Path("own.yaml"))
    assert command(config, "runs/it's mine") == (
        "footfall compare 'runs/it'\"'\"'s mine' --robot 'my robot' --scenarios two,one --seed 7"
        " --episodes 5 --scenario-file own.yaml --plant 'a b.xml' --ground-truth --html report.html"
    )


def test_brackets_in_a_name_are_not_markup() -> None:
    printed = io.StringIO()
    falls = {"falls": 4, "fall_rate": 4 / 24, "fall_rate_interval": [0.1, 0.2]}
    one = {"episodes": 24, "failed_episodes": [], "notes": [], **falls}
    print_results({"[bold]mine": {"scenarios": {"one": one}}}, Console(file=printed, width=200))
    assert printed.getvalue().count("[bold]mine") == 2  # over its column and in the verdict


def test_the_origin_names_trainer_motion_prior_and_estimate(contract: Contract, go1: Robot) -> None:
    def learned(contract: Contract, **facts: str) -> Any:
        return SimpleNamespace(contract=contract, rate_hz=50.0, needs_estimate=False, **facts)

    assert contract.gait is not None
    assert any(contract.gait.amplitude_rad)
    assert "2.2 Hz (a motion prior)" in policy_description(learned(contract))
    without = replace(contract, gait=None)
    assert policy_description(learned(without)) == "learned policy, 50 Hz, no motion prior"
    by_trainer = "learned policy (trained by rsl_rl), 50 Hz, no motion prior"
    assert policy_description(learned(without, trainer="rsl_rl")) == by_trainer
    assert policy_description(load_policy("stand", go1)) == "hand-written controller, 500 Hz"
    assert "on estimated velocity" in policy_description(load_policy("mpc", go1))
