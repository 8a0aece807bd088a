"""How each gait walks: five metres straight ahead, and round a rectangle steered by the robot's own odometry.

    python benchmarks/gait_walks.py --workers 16 --out gait_walks.jsonl

Every gait of every robot, over the simulated bus with the scenarios' sensor noise. The straight walk is told
a velocity and nothing else; what it drifts is the gait's. The rectangle, 2 by 1 m, is a mission by odometry;
what counts is how far from its start the robot really stands at the end. Prints a table.
"""

import argparse
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from resumable_runs import add_options, run_resumable

from footfall.common.rotations import heading, heading_matrix, wrap_angle
from footfall.deploy.command_source import CommandSource, Scheduled
from footfall.deploy.config import deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.evaluate.scenarios import load_scenarios
from footfall.operate.abilities import abilities_of
from footfall.operate.missions.mission import mission_of
from footfall.operate.missions.source import MissionSource
from footfall.plant.episode import Episode, Watch, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.plant.trace import Trace
from footfall.policies.controllers.walk import Walk
from footfall.policies.policy import Policy
from footfall.policies.registry import load_policy, walking_controllers
from footfall.robots.description import Robot, available_robots, load_robot

WAY_M = 5.0
SIZE = "2x1"
SHARE = 0.5  # of the robot's highest commands
LONGEST_S = 400.0
STAND_S = 3.0  # at the end, so that the gait comes to rest


class Trial(NamedTuple):
    """One walk."""

    robot: str
    gait: str
    course: str  # straight or rectangle
    seed: int


def walk(trial: Trial) -> dict[str, Any]:
    """One walk and its figures."""
    robot = load_robot(trial.robot)
    policy = load_policy(trial.gait, robot)
    if not isinstance(policy, Walk):
        raise TypeError(f"{trial.gait} is no gait of the generator")
    course = _straight if trial.course == "straight" else _rectangle
    return {**trial._asdict(), **course(robot, policy, load_scenarios(robot).noise, trial.seed)}


def _straight(robot: Robot, policy: Walk, noise: Any, seed: int) -> dict[str, Any]:
    ahead = np.array([SHARE * robot.description.commands.forward_m_s[1], 0.0, 0.0])
    start: list[float] = []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if not loop.walking or loop.now_us % 100_000:
            return
        x = float(body.truth().base_position[0])
        if not start:
            start.append(x)
        if x - start[0] >= WAY_M:
            loop.finish()

    trace = _run(robot, policy, noise, seed, Scheduled(lambda _: ahead), watch)
    went, turned = _moved(trace)
    height = trace.base_position[:, 2]
    late = len(height) // 4
    return {
        "fell": trace.fell,
        "faults": list(trace.faults),
        "notes": list(trace.notes),
        "way_m": float(went[0]),
        "speed_m_s": float(went[0] / max(trace.time_s[-1], 1e-9)),
        "sideways_percent": 100.0 * float(abs(went[1])) / max(float(went[0]), 1e-9),
        "turned_deg": math.degrees(abs(turned)),
        "lowest_m": float(height[late:].min()),
        "sunk_m": float(height[late : 2 * late].mean() - height[-late:].mean()) if late else 0.0,
    }


def _rectangle(robot: Robot, policy: Walk, noise: Any, seed: int) -> dict[str, Any]:
    mission = mission_of({"steps": [{"rectangle": SIZE}, {"stand": STAND_S}]}, "rectangle")
    source = MissionSource(mission, policy.name, abilities_of({policy.name: policy}, robot))
    trace = _run(robot, policy, noise, seed, source)
    went, turned = _moved(trace)
    return {
        "fell": trace.fell,
        "faults": list(trace.faults),
        "came_round": source.progress.done,
        "lap_s": float(trace.time_s[-1] - STAND_S),
        "closing_m": float(np.hypot(went[0], went[1])),
        "turned_deg": math.degrees(wrap_angle(turned)),
    }


def _run(
    robot: Robot, policy: Policy, noise: Any, seed: int, source: CommandSource, watch: Watch | None = None
) -> Trace:
    episode = Episode(
        command_source=source,
        duration_s=LONGEST_S,
        seed=seed,
        noise=noise,
        record_rate_hz=20.0,
        config=replace(deploy_config(robot), odometry=True),
    )
    return run_episode(robot, policy, episode, watch)


def _moved(trace: Trace) -> tuple[np.ndarray, float]:
    """Displacement (3,) m in the frame of the start, and how far it has turned in all, rad."""
    yaw = np.unwrap([float(heading(quaternion)) for quaternion in trace.base_quaternion])
    return heading_matrix(-yaw[0]) @ (trace.base_position[-1] - trace.base_position[0]), yaw[-1] - yaw[0]


def table(walks: list[dict[str, Any]]) -> Iterator[str]:
    """A row for each gait, in Markdown."""
    yield (
        "| robot | gait | falls | speed, m/s | sideways, % of 5 m: median, worst | turned, degrees: worst |"
        " lowest base, m | sunk, m: worst | rectangle closes, m: median, worst | lap, s |"
    )
    yield "|" + " --- |" * 10
    for robot, gait in dict.fromkeys((walk["robot"], walk["gait"]) for walk in walks):
        own = [walk for walk in walks if (walk["robot"], walk["gait"]) == (robot, gait)]
        straight = [walk for walk in own if walk["course"] == "straight"]
        round_ = [walk for walk in own if walk["course"] == "rectangle"]
        closing = [walk["closing_m"] if walk["came_round"] else math.inf for walk in round_]
        yield (
            f"| {robot} | {gait} | {sum(walk['fell'] for walk in own)} of {len(own)} |"
            f" {_median(straight, 'speed_m_s'):.3f} |"
            f" {_median(straight, 'sideways_percent'):.1f}, {_worst(straight, 'sideways_percent'):.1f} |"
            f" {_worst(straight, 'turned_deg'):.1f} |"
            f" {min((walk['lowest_m'] for walk in straight), default=math.nan):.3f} |"
            f" {_worst(straight, 'sunk_m'):.3f} |"
            f" {np.median(closing) if closing else math.nan:.3f}, {max(closing, default=math.nan):.3f} |"
            f" {_median(round_, 'lap_s'):.0f} |"
        )


def _median(walks: list[dict[str, Any]], key: str) -> float:
    return float(np.median([walk[key] for walk in walks])) if walks else math.nan


def _worst(walks: list[dict[str, Any]], key: str) -> float:
    return max((walk[key] for walk in walks), default=math.nan)


def _gaits(name: str) -> list[str]:
    robot = load_robot(name)
    return [each for each in walking_controllers(robot) if isinstance(load_policy(each, robot), Walk)]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", default=",".join(available_robots()))
    parser.add_argument("--gaits", default="", help="A,B: these only, of those that each robot has")
    parser.add_argument("--courses", default="straight,rectangle")
    parser.add_argument("--seeds", type=int, default=5, help="walks of each kind")
    add_options(parser)
    options = parser.parse_args()
    wanted = [name for name in options.gaits.split(",") if name]
    trials = [
        Trial(robot, gait, course, seed)
        for robot in options.robots.split(",")
        for gait in _gaits(robot)
        if not wanted or gait in wanted
        for course in options.courses.split(",")
        for seed in range(options.seeds)
    ]
    walks, errors = run_resumable(walk, trials, options.out, options.workers, options.time_limit)
    for line in [*table(walks), *errors]:
        print(line)


if __name__ == "__main__":
    main()
