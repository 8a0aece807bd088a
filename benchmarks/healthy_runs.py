"""Runs of healthy robots that are pushed, on which the supervisor shall not stop: false alarms.

No benchmark itself: `fault_table.py` calls it.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from fault_subjects import NOISE, HealthyTask, drawn_command, ground_of, policy_of, robot_of

from footfall.deploy.config import DeployConfig, deploy_config
from footfall.deploy.wiring import wire
from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import draw
from footfall.plant.episode import Episode, Push, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import SimulatedWires

EPISODE_S = 6.0  # of each run
FALL_S = 1.0  # that a robot takes at most to lie on the ground once it cannot be held any more
PUSH_M_S = 0.6


def run_healthy(task: HealthyTask) -> dict[str, Any]:
    """One run of a healthy robot that is pushed: what its supervisor said, if anything.

    Whatever it said is a false alarm unless the robot was falling. The same run tells by limits that no fall
    reaches: it goes the same way until then, and within `FALL_S` the simulator sees the robot down, or not.
    """
    task = HealthyTask(*task)
    config = deploy_config(robot_of(task.robot))
    walk = _walk(task, config)
    fell_s = walk.fell_s
    if walk.fault and fell_s is None:
        fell_s = _walk(task, _beyond_falls(config)).fell_s
    down = fell_s is not None and (walk.fault_s is None or fell_s <= walk.fault_s + FALL_S)
    return {
        **task._asdict(),
        "fell": down,
        "fell_s": fell_s,
        "alarm": "" if down else walk.fault,
        "fault": walk.fault,
        "fault_s": walk.fault_s,
    }


def _beyond_falls(config: DeployConfig) -> DeployConfig:
    """The same limits, but for those that a falling robot goes beyond: it lies on the ground then."""
    sensors = replace(config.safety.sensors, sunk=1.0, rotation_rad=math.pi, lean_error=2.0, lift_error=2.0)
    return replace(config, safety=replace(config.safety, tilt_limit_rad=math.pi / 2, sensors=sensors))


class Walk(NamedTuple):
    """How a healthy robot's walk ended. Times are of walking, s."""

    fault: str  # what the supervisor said; empty if nothing
    fault_s: float | None
    fell_s: float | None  # when the simulator saw it down; None if a fault came first


def _walk(task: HealthyTask, config: DeployConfig) -> Walk:
    robot, seed = robot_of(task.robot), task.seed
    rng = np.random.default_rng([seed, int(task.randomised)])
    sample = None
    if task.randomised:
        bodies = SimulatedRobot(robot, wire(robot), SimulatedWires(wire(robot).buses)).model.nbody - 1
        sample = draw(
            randomisation_of(robot), lambda count: rng.uniform(size=count), len(robot.joint_names), bodies
        )
    schedule = [drawn_command(rng) for _ in range(3)]
    pushes = tuple(_drawn_push(rng, at_s) for at_s in (1.5, 4.0))
    episode = Episode(
        command_source=lambda t: schedule[min(int(t / 2.0), 2)],
        duration_s=EPISODE_S,
        seed=seed,
        sample=sample,
        ground=ground_of(task.subject, seed),
        noise=NOISE,
        pushes=pushes,
        record=False,
        config=config,
    )
    trace = run_episode(robot, policy_of(task.robot, task.policy), episode)
    fault = trace.faults[0] if trace.faults else ""
    seen = trace.fell and trace.fall_reason != fault  # by the simulator, not by the supervisor
    return Walk(fault, trace.walked_s if fault else None, trace.walked_s if seen else None)


def _drawn_push(rng: np.random.Generator, at_s: float) -> Push:
    angle, size = rng.uniform(0.0, math.tau), rng.uniform(0.0, PUSH_M_S)
    return Push(at_s + rng.uniform(0.0, 0.7), (size * math.cos(angle), size * math.sin(angle), 0.0))
