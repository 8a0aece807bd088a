"""What an evaluation runs: tasks, episodes and figures. No episode is run here."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from outcomes import GOOD, outcome
from scenario_file import FILE, OWN_NOISE
from traces import walk

from footfall.evaluate import episodes, suite
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.episodes import EpisodeTask, run_with
from footfall.evaluate.metrics import score
from footfall.evaluate.plan import CommandSchedule, EpisodePlan, plan_episodes
from footfall.evaluate.pool import TaskResult
from footfall.evaluate.scenarios import Scenario
from footfall.evaluate.suite import CourseWalk
from footfall.plant.episode import Push
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot
from footfall.terrain.declaration import GroundConfig

PLANT = Path("other.xml")


CONFIG = EvaluationConfig("go1", ("two", "one"), seed=7, plant=PLANT, ground_truth=True, workers=3)


class TestSuite:
    @pytest.fixture
    def calls(self, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
        """Tasks and workers of each call; a task's distance encodes its policy, index and scenario."""
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
            + 10.0 * ["one", "two", "course", "stairs"].index(plan.scenario)
            + plan.index
        )

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
            assert task.ground_truth
            assert not task.keep_trace

    def test_the_course_is_walked_once_by_each_and_recorded(self, calls: list[Any]) -> None:
        walks = suite.run_course(["b", "a"], CONFIG, FILE)
        ((tasks, workers),) = calls
        (plan,) = plan_episodes("course", FILE.scenarios["course"], 7, 1)
        assert workers == 1
        assert [(task.policy, task.plan, task.keep_trace) for task in tasks] == [
            ("b", plan, True),
            ("a", plan, True),
        ]
        assert all((task.noise, task.plant, task.ground_truth) == (OWN_NOISE, PLANT, True) for task in tasks)
        compute = {"compute_ms": {"p50": 5.0, "p99": pytest.approx(8.92)}, "missed_deadlines": 0.5}
        assert walks == {name: CourseWalk(plan, f"trace of {name}", compute, "") for name in ("b", "a")}

    def test_the_highest_level_of_each_ground_is_recorded(self, calls: list[Any]) -> None:
        stairs = Scenario(
            "Stairs", 4, 1.0, ground=GroundConfig("stairs"), levels={"step_m": (0.05, 0.2, -0.3, 0.1)}
        )
        file = replace(FILE, scenarios={**FILE.scenarios, "stairs": stairs})
        walks = suite.run_grounds(["b", "a"], replace(CONFIG, scenarios=("two", "stairs")), file)
        ((tasks, _),) = calls
        assert [(task.policy, task.plan.levels, task.keep_trace) for task in tasks] == [
            ("b", {"step_m": 0.2}, True),
            ("a", {"step_m": 0.2}, True),
        ]
        assert {name: list(by) for name, by in walks.items()} == {"b": ["stairs"], "a": ["stairs"]}
        assert walks["a"]["stairs"].trace == "trace of a"


class TestEpisode:
    PLAN = EpisodePlan(
        "own", 4, 11, 2.5, CommandSchedule((0.0,), ((0.5, 0.0, 0.0),)), (Push(1.0, (0.0, 0.3, 0.0)),),
        {"payload_kg": 2.0, "friction": 0.3}, False,
    )  # fmt: skip

    @pytest.fixture
    def ran(self, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        """Arguments of the simulation's call; it returns `trace`."""
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

    def test_trouble_is_each_reason_once_the_fall_first(self, ran: SimpleNamespace, go1: Robot) -> None:
        faults = ("motor 3 is hot", "it tilted", "motor 3 is hot")
        ran.trace = replace(ran.trace, fell=True, fall_reason="it tilted", faults=faults)
        assert run_with(load_policy("stand", go1), self.task()).trouble == "it tilted; motor 3 is hot"
        ran.trace = replace(ran.trace, fall_reason="", faults=())
        assert run_with(load_policy("stand", go1), self.task()).trouble == ""
