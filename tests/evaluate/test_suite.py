"""Tasks, episodes and figures of an evaluation. No episode is run here."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from outcomes import FILE, GOOD, OWN_NOISE, outcome

from footfall.evaluate import suite
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.plan import EpisodePlan, plan_episodes
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.scenarios import Scenario
from footfall.evaluate.suite import CourseWalk
from footfall.terrain.declaration import GroundConfig

PLANT = Path("other.xml")
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
