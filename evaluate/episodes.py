"""One task of a worker process: set up an episode, run it, score it."""

from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from footfall.common.engines import DEFAULT_ENGINE
from footfall.deploy.config import deploy_config
from footfall.deploy.recovery import GetUp
from footfall.domain_rand.bodies import body_map, randomised_fields
from footfall.domain_rand.height_scan import HeightScanErrors
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import Sample, draw, sample_shapes
from footfall.evaluate.metrics import EpisodeMetrics, score
from footfall.evaluate.missions import MakeMission, MissionRun, MissionScore, make_mission, score_mission
from footfall.evaluate.own_metrics import score_own
from footfall.evaluate.plan import EpisodePlan, Levels
from footfall.plant.episode import Episode, run_episode
from footfall.plant.trace import Trace
from footfall.policies.policy import Policy
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import plant_model
from footfall.terrain.declaration import make_ground


@dataclass(frozen=True)
class EpisodeTask:
    """An episode to run, as plain data."""

    policy: str  # as `footfall.policies.registry.load_policy` takes it
    robot: str  # as `footfall.robots.description.load_robot` takes it
    plan: EpisodePlan
    noise: Noise
    height_scan_errors: HeightScanErrors = field(default_factory=HeightScanErrors)
    plant: Path | None = None
    engine: str = DEFAULT_ENGINE
    ground_truth: bool = False
    get_up: str | None = None  # policy that gets the robot up after a fall, like `policy`
    keep_trace: bool = False
    metrics: tuple[str, ...] = ()  # of the user, MODULE:NAME each
    mission_run: MakeMission | None = None  # needed if the plan has a mission


@dataclass(frozen=True)
class EpisodeOutcome:
    """The result of an episode."""

    metrics: EpisodeMetrics
    levels: Levels
    compute_ms: np.ndarray  # (policy steps,)
    period_ms: float  # of the policy
    trouble: str  # why the robot fell or stopped; empty after an orderly end
    notes: tuple[str, ...]
    trace: Trace | None
    own: dict[str, float] = field(default_factory=dict)  # metrics of the user by name
    recovery_s: tuple[float, ...] | None = None  # from each fall until the robot stood; None without `get_up`
    mission: MissionScore | None = None  # if the scenario has a mission


def run_task(task: EpisodeTask) -> EpisodeOutcome:
    """Run one episode in lockstep. Robot and policy are built once in a process.

    Raises:
        UserError: robot, policy or plant do not fit together.
    """
    return run_with(_policy(task.policy, task.robot), task)


def run_with(policy: Policy, task: EpisodeTask) -> EpisodeOutcome:
    """Run one episode in lockstep with this policy instead of the task's.

    Raises:
        UserError: as `run_task`.
    """
    robot = _robot(task.robot)
    model = _model(task.robot, task.plant)
    plan = task.plan
    sample = sample_of(plan, robot, model.nbody - 1)
    mission = _mission(policy, task, robot)
    episode = Episode(
        command_source=mission.source if mission else plan.schedule,
        duration_s=plan.duration_s,
        seed=plan.seed,
        plant=task.plant,
        engine=task.engine,
        ground=None if plan.ground is None else make_ground(plan.ground, plan.seed),
        sample=sample,
        noise=task.noise,
        height_scan_errors=task.height_scan_errors,
        pushes=plan.pushes,
        ground_truth=task.ground_truth,
        get_up=None if task.get_up is None else GetUp(_policy(task.get_up, task.robot), task.get_up),
        others=mission.others if mission else {},
        config=replace(deploy_config(robot), odometry=True) if mission else None,
    )
    trace = run_episode(robot, policy, episode)
    mission_score = score_mission(mission.source, trace) if mission else None
    troubles = (trace.fall_reason, *trace.faults, mission_score.trouble if mission_score else "")
    return EpisodeOutcome(
        metrics=score(trace, robot, _weight(model, robot, sample)),
        levels=plan.levels,
        compute_ms=trace.compute_ms.astype(np.float32),
        period_ms=1e3 / policy.rate_hz,
        trouble="; ".join(dict.fromkeys(filter(None, troubles))),
        notes=trace.notes,
        trace=trace if task.keep_trace else None,
        own=score_own(task.metrics, trace, robot),
        recovery_s=None
        if task.get_up is None
        else tuple(each.stood_s - each.fell_s for each in trace.recoveries),
        mission=mission_score,
    )


def _mission(policy: Policy, task: EpisodeTask, robot: Robot) -> MissionRun | None:
    """The mission that steers the robot, or None."""
    plan = task.plan
    if plan.mission is None:
        return None
    return make_mission(task.mission_run, plan.mission, plan.scenario, task.policy, policy, robot)


def sample_of(plan: EpisodePlan, robot: Robot, bodies: int) -> Sample | None:
    """Differences of an episode's robot from the nominal one; None if there are none.

    Args:
        plan: the episode; its levels apply to all joints or bodies, and override drawn values.
        robot: the robot.
        bodies: number of bodies of the plant, without the world.
    """
    sample: Sample = {}
    joints = len(robot.joint_names)
    if plan.randomised:
        rng = np.random.default_rng(plan.seed)
        sample = draw(randomisation_of(robot), rng.random, joints, bodies, robot.foot_sensors)
    shapes = sample_shapes(joints, bodies, robot.foot_sensors)
    fixed = {name: np.full(shapes[name], value) for name, value in plan.levels.items() if name in shapes}
    return sample | fixed or None


def _weight(model: mujoco.MjModel, robot: Robot, sample: Sample | None) -> float:
    """Weight of the simulated robot, N."""
    changed = {} if sample is None else randomised_fields(model, sample, body_map(model, robot))
    mass = changed.get("body_mass", model.body_mass)
    return float(mass.sum() * np.linalg.norm(model.opt.gravity))


@cache
def _robot(spec: str) -> Robot:
    return load_robot(spec)


@cache
def _policy(spec: str, robot: str) -> Policy:
    return load_policy(spec, _robot(robot))


@cache
def _model(robot: str, plant: Path | None) -> mujoco.MjModel:
    return plant_model(_robot(robot), plant)
