"""Runs policies through scenarios in parallel processes, and collects the figures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.episodes import EpisodeOutcome, EpisodeTask, run_task
from footfall.evaluate.plan import EpisodePlan, plan_episodes
from footfall.evaluate.pool import TaskResult, run_all
from footfall.evaluate.scenarios import GROUND_LEVELS, ScenarioFile
from footfall.evaluate.summary import Summary, compute_figures, summarise
from footfall.plant.trace import Trace

COURSE = "course"  # the scenario that is filmed and on which time per step is measured


@dataclass(frozen=True)
class CourseWalk:
    """One policy in one recorded episode: on the test course, or on a ground."""

    plan: EpisodePlan
    trace: Trace | None
    compute: Summary  # compute_ms and missed_deadlines
    error: str  # the reason if there is no trace


def run_suite(
    policies: Sequence[str],
    config: EvaluationConfig,
    file: ScenarioFile,
    on_progress: Callable[[int, int], None] | None = None,
) -> dict[str, dict[str, Summary]]:
    """Figures of each policy on each scenario: {policy: {scenario: figures}}.

    Only the time per step depends on the number of workers.

    Args:
        policies: policies, as for `load_policy`, without repetition.
        config: the settings that they share.
        file: the scenarios' definitions.
        on_progress: called with the number of finished episodes and the number of all.

    Raises:
        UserError: a scenario, policy, robot or plant does not exist or does not fit.
    """
    chosen = file.select(config.scenarios)
    plans = {
        name: plan_episodes(name, scenario, config.seed, config.episodes) for name, scenario in chosen.items()
    }
    pairs = [
        (policy, name, plan) for name, episodes in plans.items() for plan in episodes for policy in policies
    ]
    tasks = [_task(policy, plan, config, file) for policy, _, plan in pairs]
    on_finished = None if on_progress is None else lambda finished: on_progress(finished, len(tasks))
    outcomes = run_all(run_task, tasks, config.workers, on_finished)
    outcomes_of: dict[tuple[str, str], list[TaskResult[EpisodeOutcome]]] = {}
    for (policy, name, _), outcome in zip(pairs, outcomes, strict=True):
        outcomes_of.setdefault((policy, name), []).append(outcome)
    return {
        policy: {
            name: summarise(scenario, outcomes_of[policy, name], config.seed)
            for name, scenario in chosen.items()
        }
        for policy in policies
    }


def run_course(
    policies: Sequence[str], config: EvaluationConfig, file: ScenarioFile
) -> dict[str, CourseWalk]:
    """Each policy once over the course, one at a time, so that other episodes do not disturb its timing."""
    (plan,) = plan_episodes(COURSE, file.scenarios[COURSE], config.seed, 1)
    tasks = [_task(policy, plan, config, file, keep_trace=True) for policy in policies]
    outcomes = run_all(run_task, tasks, workers=1)
    return {policy: _course_walk(plan, outcome) for policy, outcome in zip(policies, outcomes, strict=True)}


def run_grounds(
    policies: Sequence[str], config: EvaluationConfig, file: ScenarioFile
) -> dict[str, dict[str, CourseWalk]]:
    """Each policy once on the highest level of each scenario with a ground: {policy: {scenario: walk}}."""
    plans = {
        name: max(plan_episodes(name, scenario, config.seed), key=_ground_level)
        for name, scenario in file.select(config.scenarios).items()
        if scenario.ground is not None
    }
    pairs = [(policy, name) for policy in policies for name in plans]
    tasks = [_task(policy, plans[name], config, file, keep_trace=True) for policy, name in pairs]
    outcomes = run_all(run_task, tasks, config.workers)
    walks: dict[str, dict[str, CourseWalk]] = {policy: {} for policy in policies}
    for (policy, name), outcome in zip(pairs, outcomes, strict=True):
        walks[policy][name] = _course_walk(plans[name], outcome)
    return walks


def _ground_level(plan: EpisodePlan) -> float:
    return max((plan.levels[name] for name in GROUND_LEVELS if name in plan.levels), default=0.0)


def _task(
    policy: str, plan: EpisodePlan, config: EvaluationConfig, file: ScenarioFile, keep_trace: bool = False
) -> EpisodeTask:
    return EpisodeTask(
        policy=policy,
        robot=config.robot,
        plan=plan,
        noise=file.noise,
        height_scan_errors=file.height_scan_errors,
        plant=config.plant,
        engine=config.engine,
        ground_truth=config.ground_truth,
        get_up=config.get_up,
        keep_trace=keep_trace,
        metrics=config.metrics,
        mission_run=config.mission_run,
    )


def _course_walk(plan: EpisodePlan, outcome: TaskResult[EpisodeOutcome]) -> CourseWalk:
    episode = outcome.value
    if episode is None:
        return CourseWalk(plan, None, compute_figures(np.zeros(0), 1.0), outcome.error)
    return CourseWalk(plan, episode.trace, compute_figures(episode.compute_ms, episode.period_ms), "")
