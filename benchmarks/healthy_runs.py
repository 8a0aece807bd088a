"""Runs of healthy robots, which the supervisor should not stop: the rate of false alarms.

Not a benchmark itself: `fault_table.py` calls it.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from fault_subjects import NOISE, HealthyTask, drawn_command, ground_of, policy_of, robot_of

from footfall.deploy.command_source import VelocityFunction
from footfall.deploy.config import DeployConfig, deploy_config
from footfall.deploy.wiring import wiring_of
from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import draw
from footfall.evaluate.plan import plan_episodes
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, Push, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.plant.wires import SimulatedWires
from footfall.robots.description import Robot

KINDS = ("nominal", "pushed", "randomised")  # no pushes; pushes; pushes and a new random robot in each run
EPISODE_S = 6.0  # duration of a run with pushes
NOMINAL_S = 12.0  # duration of a run without pushes
FALL_S = 1.0  # longest time in which a robot that tips over reaches the ground
PUSH_M_S = 0.6


def run_healthy(task: HealthyTask) -> dict[str, Any]:
    """One run of a healthy robot, as a JSON object with the fault that its supervisor reported, if any.

    A fault is a false alarm unless the robot was falling. To find out, the run is repeated with limits that
    no fall reaches: it is identical until the fault. The robot was falling if it is down within `FALL_S`.
    """
    task = HealthyTask(*task)
    config = deploy_config(robot_of(task.robot))
    walk = _walk(task, config)
    fell_s = walk.fell_s
    if walk.fault and fell_s is None:
        fell_s = _walk(task, _beyond_falls(config)).fell_s
    fell = fell_s is not None and (walk.fault_s is None or fell_s <= walk.fault_s + FALL_S)
    return {
        **task._asdict(),
        "fell": fell,
        "fell_s": fell_s,
        "alarm": "" if fell else walk.fault,
        "fault": walk.fault,
        "fault_s": walk.fault_s,
    }


def _beyond_falls(config: DeployConfig) -> DeployConfig:
    """The same settings, with limits of tilt and of the sensor checks that no fall reaches."""
    sensors = replace(
        config.safety.sensors, sunk=1.0, rotation_rad=math.pi, lateral_error=2.0, lift_error=2.0
    )
    return replace(config, safety=replace(config.safety, tilt_limit_rad=math.pi / 2, sensors=sensors))


Course = tuple[VelocityFunction, tuple[Push, ...], float]  # commands, pushes, duration in s


class Walk(NamedTuple):
    """The end of a healthy robot's walk. Times count from the start of walking, s."""

    fault: str  # the supervisor's message; empty without a fault
    fault_s: float | None
    fell_s: float | None  # time of the fall in the simulator; None if the run ended with a fault before


def _walk(task: HealthyTask, config: DeployConfig) -> Walk:
    robot, seed = robot_of(task.robot), task.seed
    rng = np.random.default_rng([seed, KINDS.index(task.kind)])
    sample = None
    if task.kind == "randomised":
        wiring = wiring_of(robot)
        bodies = SimulatedRobot(robot, wiring, SimulatedWires(wiring.buses)).model.nbody - 1
        sample = draw(
            randomisation_of(robot), lambda count: rng.uniform(size=count), len(robot.joint_names), bodies
        )
    schedule, pushes, duration_s = (_nominal if task.kind == "nominal" else _pushed)(robot, rng)
    episode = Episode(
        command_source=schedule,
        duration_s=duration_s,
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
    seen_by_simulator = trace.fell and trace.fall_reason != fault  # not by the supervisor
    return Walk(fault, trace.walked_s if fault else None, trace.walked_s if seen_by_simulator else None)


def _nominal(robot: Robot, rng: np.random.Generator) -> Course:
    """Commands over the robot's whole range, those of the scenario `nominal`."""
    scenario = replace(load_scenarios(robot).scenarios["nominal"], duration_s=NOMINAL_S)
    (plan,) = plan_episodes("nominal", scenario, int(rng.integers(2**31)), 1)
    return plan.schedule, (), NOMINAL_S


def _pushed(robot: Robot, rng: np.random.Generator) -> Course:
    """Slow commands and two pushes."""
    commands = [drawn_command(rng) for _ in range(3)]
    pushes = tuple(_drawn_push(rng, at_s) for at_s in (1.5, 4.0))
    return lambda time_s: commands[min(int(time_s / 2.0), 2)], pushes, EPISODE_S


def _drawn_push(rng: np.random.Generator, at_s: float) -> Push:
    angle, size = rng.uniform(0.0, math.tau), rng.uniform(0.0, PUSH_M_S)
    return Push(at_s + rng.uniform(0.0, 0.7), (size * math.cos(angle), size * math.sin(angle), 0.0))
