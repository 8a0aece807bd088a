"""The smallest push, latency, loss of friction or loss of motor strength at which a policy fails.

The robot falls, or it stays up without progress, as on ice. In each episode a bisection finds where failures
begin; it cannot see failures at smaller disturbances. For several disturbances together, CMA-ES searches the
direction in which the smallest combination fails.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from footfall.common.errors import UserError
from footfall.common.installation import needs_extra
from footfall.evaluate.config import EvaluationConfig
from footfall.evaluate.episodes import EpisodeOutcome, EpisodeTask, run_task
from footfall.evaluate.metrics import SUCCESS_PROGRESS
from footfall.evaluate.plan import EpisodePlan, plan_episodes
from footfall.evaluate.pool import run_all
from footfall.evaluate.scenarios import ScenarioFile
from footfall.evaluate.statistics import CONFIDENCE
from footfall.plant.episode import Push

SCENARIO = "push"  # scenario that is disturbed; times and directions of its pushes are kept
BISECTION_STEPS = 8  # resolution: 1/256 of a disturbance's range
EPISODES = 12
GENERATIONS, POPULATION, START_STEP = 8, 6, 0.3  # of CMA-ES
RESAMPLES = 1000


@dataclass(frozen=True)
class Disturbance:
    """A quantity whose effect grows from `mild` to `worst`."""

    unit: str
    mild: float
    worst: float
    quantity: str = ""  # of `domain_rand/randomisation.py`; empty for a push

    def at(self, severity: float) -> float:
        """Its value at a severity from 0 to 1."""
        return self.mild + severity * (self.worst - self.mild)


DISTURBANCES = {
    "push": Disturbance("m/s", 0.0, 8.0),
    "latency": Disturbance("s", 0.0, 0.25, "action_delay_s"),
    "friction": Disturbance("", 1.0, 0.0, "friction"),
    "strength": Disturbance("of the torque", 1.0, 0.0, "motor_strength"),
}
Severities = dict[str, float]  # of disturbances by name, each from 0 to 1


@dataclass(frozen=True)
class Ray:
    """One bisection, in one episode: all severities grow in proportion."""

    task: EpisodeTask
    direction: Severities  # severities at share 1


def disturbed(plan: EpisodePlan, severities: Severities) -> EpisodePlan:
    """An episode of the scenario with these disturbances instead of its push."""
    (push,) = plan.pushes
    norm = math.hypot(*push.delta_v_m_s)
    size = DISTURBANCES["push"].at(severities.get("push", 0.0)) / norm
    x, y, z = (size * each for each in push.delta_v_m_s)
    levels = {
        DISTURBANCES[name].quantity: DISTURBANCES[name].at(severity)
        for name, severity in severities.items()
        if DISTURBANCES[name].quantity
    }
    return replace(plan, pushes=(Push(push.time_s, (x, y, z)),) if size else (), levels=levels)


def smallest(fails: Callable[[float], bool], halvings: int = BISECTION_STEPS) -> float:
    """Smallest share, from 0 to 1, at which `fails` is true; infinite if it is false at 1.

    It is 0 for a policy that fails without a disturbance.
    """
    if not fails(1.0):
        return math.inf
    low, high = 0.0, 1.0
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if fails(middle) else (middle, high)
    return 0.0 if low == 0.0 and fails(0.0) else high


def bisect(ray: Ray) -> float:
    """Share of a ray from which on its policy falls or makes no progress; infinite if it does not.

    A push changes the path: on rays with a push, and for a policy that does not walk, only falls count.
    """

    def run(share: float) -> EpisodeOutcome:
        severities = {name: min(1.0, share * end) for name, end in ray.direction.items()}
        return run_task(replace(ray.task, plan=disturbed(ray.task.plan, severities)))

    progress_counts = "push" not in ray.direction and run(0.0).metrics.progress >= SUCCESS_PROGRESS

    def fails(share: float) -> bool:
        outcome = run(share)
        return bool(outcome.trouble) or (progress_counts and outcome.metrics.progress < SUCCESS_PROGRESS)

    return smallest(fails)


def weakest(
    policy: str, config: EvaluationConfig, file: ScenarioFile, names: Sequence[str]
) -> dict[str, Any]:
    """Smallest disturbances at which a policy fails, each alone, and all combined if there are several.

    Args:
        policy: policy, as for `load_policy`.
        config: robot, seed, episodes, plant, workers.
        file: the scenarios' definitions.
        names: names of `DISTURBANCES`.

    Returns:
        {name: figures}, and under "together" the smallest combination, in one episode.

    Raises:
        UserError: there is no such disturbance, or the extra for several of them is not installed.
    """
    unknown = [name for name in names if name not in DISTURBANCES]
    if unknown:
        raise UserError(f"--weakest {unknown[0]}: give some of {', '.join(DISTURBANCES)}")
    if len(set(names)) < len(names):
        raise UserError(f"--weakest {','.join(names)}: name each disturbance once")
    if len(names) > 1:
        _cma_es()
    plans = plan_episodes(SCENARIO, file.scenarios[SCENARIO], config.seed, config.episodes or EPISODES)
    tasks = [
        EpisodeTask(
            policy, config.robot, plan, file.noise, file.height_scan_errors, config.plant, config.engine
        )
        for plan in plans
    ]
    rays = [Ray(task, {name: 1.0}) for name in names for task in tasks]
    shares = np.array(_run(rays, config.workers)).reshape(len(names), len(tasks))
    results = {name: _figures(name, row, config.seed) for name, row in zip(names, shares, strict=True)}
    if len(names) > 1:
        alone = dict(zip(names, np.minimum(shares[:, 0], 1.0).tolist(), strict=True))
        results["together"] = _combined(tasks[0], alone, config)
    return results


def _run(rays: Sequence[Ray], workers: int | None) -> list[float]:
    outcomes = run_all(bisect, rays, workers)
    failed = next((outcome.error for outcome in outcomes if outcome.value is None), None)
    if failed is not None:
        raise UserError(f"an episode cannot be run: {failed}")
    return [outcome.value for outcome in outcomes if outcome.value is not None]


def _figures(name: str, shares: np.ndarray, seed: int) -> dict[str, Any]:
    """Smallest and median disturbance at which the policy fails, in its unit; None if it does not."""
    resamples = np.random.default_rng(seed).choice(shares, (RESAMPLES, len(shares)))
    medians = np.sort(np.quantile(resamples, 0.5, axis=1, method="lower"))
    tail = (1 - CONFIDENCE) / 2
    edges = medians[int(tail * (RESAMPLES - 1))], medians[int((1 - tail) * (RESAMPLES - 1))]
    return {
        "unit": DISTURBANCES[name].unit,
        "smallest": _value(name, shares.min()),
        "median": _value(name, np.quantile(shares, 0.5, method="lower")),
        "interval": [_value(name, end) for end in edges],
        "episodes": len(shares),
        "never_fell": int(np.isinf(shares).sum()),
    }


def _value(name: str, share: float) -> float | None:
    return None if math.isinf(share) else DISTURBANCES[name].at(float(share))


def _combined(task: EpisodeTask, alone: Severities, config: EvaluationConfig) -> dict[str, Any]:
    """The smallest combination of disturbances at which the policy fails in one episode.

    Its size is the norm of each disturbance over its size alone: 1 is no smaller than a single disturbance.
    """
    names, scale = list(alone), math.sqrt(len(alone))
    search = _cma_es()(
        np.full(len(names), 1.0 / scale).tolist(),
        START_STEP,
        {"popsize": POPULATION, "seed": config.seed + 1, "verbose": -9},
    )
    best = (1.0, np.eye(len(names))[0])
    for _ in range(GENERATIONS):
        points = search.ask()
        directions = [np.abs(point) / max(np.linalg.norm(point), 1e-9) for point in points]
        rays = [
            Ray(
                task,
                {name: alone[name] * component for name, component in zip(names, direction, strict=True)},
            )
            for direction in directions
        ]
        sizes = _run(rays, config.workers)
        search.tell(points, [size if math.isfinite(size) else 2.0 for size in sizes])
        best = min([best, *zip(sizes, directions, strict=True)], key=lambda each: each[0])
    size, direction = best
    values = {
        name: DISTURBANCES[name].at(size * alone[name] * component)
        for name, component in zip(names, direction.tolist(), strict=True)
    }
    return {"size": float(size), "values": values}


def _cma_es() -> Any:
    with needs_extra("sweep", "a search over several disturbances needs"):
        import cma
    return cma.CMAEvolutionStrategy
