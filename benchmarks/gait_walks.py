"""How straight and fast each gait walks over five metres.

    python benchmarks/gait_walks.py --workers 16 --out gait_walks.jsonl

Every gait of every robot walks over the simulated bus with the scenarios' sensor noise. It gets a constant
velocity command and no correction of its heading: the drift is the gait's. Prints a table.
"""

import argparse
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from resumable_runs import add_options, run_resumable

from footfall.common.rotations import heading, heading_matrix
from footfall.deploy.loop import ControlLoop
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.controllers.walk import Walk
from footfall.policies.registry import load_policy, walking_controllers
from footfall.robots.description import available_robots, load_robot

DISTANCE_M = 5.0
COMMAND_SHARE = 0.5  # of the robot's highest commands
WALK_TIMEOUT_S = 400.0


class Trial(NamedTuple):
    """One walk."""

    robot: str
    gait: str
    seed: int


def walk(trial: Trial) -> dict[str, Any]:
    """One walk and its figures."""
    robot = load_robot(trial.robot)
    policy = load_policy(trial.gait, robot)
    command = np.array([COMMAND_SHARE * robot.description.commands.forward_m_s[1], 0.0, 0.0])
    start: list[float] = []

    def watch(loop: ControlLoop, body: SimulatedRobot) -> None:
        if not loop.walking or loop.now_us % 100_000:
            return
        x = float(body.truth().base_position[0])
        if not start:
            start.append(x)
        if x - start[0] >= DISTANCE_M:
            loop.finish()

    noise = load_scenarios(robot).noise
    episode = Episode(lambda _: command, WALK_TIMEOUT_S, seed=trial.seed, noise=noise, record_rate_hz=20.0)
    trace = run_episode(robot, policy, episode, watch)
    yaw = np.unwrap([float(heading(quaternion)) for quaternion in trace.base_quaternion])
    displacement = heading_matrix(-yaw[0]) @ (trace.base_position[-1] - trace.base_position[0])
    height = trace.base_position[:, 2]
    quarter = len(height) // 4
    return {
        **trial._asdict(),
        "fell": trace.fell,
        "faults": list(trace.faults),
        "notes": list(trace.notes),
        "distance_m": float(displacement[0]),
        "speed_m_s": float(displacement[0] / max(trace.time_s[-1], 1e-9)),
        "sideways_percent": 100.0 * float(abs(displacement[1])) / max(float(displacement[0]), 1e-9),
        "turned_deg": math.degrees(abs(yaw[-1] - yaw[0])),
        "lowest_m": float(height[quarter:].min()),
        "sunk_m": float(height[quarter : 2 * quarter].mean() - height[-quarter:].mean()) if quarter else 0.0,
    }


def table(walks: list[dict[str, Any]]) -> Iterator[str]:
    """A row for each gait, in Markdown."""
    yield (
        "| robot | gait | falls | speed, m/s | sideways, % of 5 m: median, worst | turned, degrees: worst |"
        " lowest base, m | sunk, m: worst |"
    )
    yield "|" + " --- |" * 8
    for robot, gait in dict.fromkeys((walk["robot"], walk["gait"]) for walk in walks):
        own = [walk for walk in walks if (walk["robot"], walk["gait"]) == (robot, gait)]
        sideways = [walk["sideways_percent"] for walk in own]
        yield (
            f"| {robot} | {gait} | {sum(walk['fell'] for walk in own)} of {len(own)} |"
            f" {np.median([walk['speed_m_s'] for walk in own]):.3f} |"
            f" {np.median(sideways):.1f}, {max(sideways):.1f} |"
            f" {max(walk['turned_deg'] for walk in own):.1f} |"
            f" {min(walk['lowest_m'] for walk in own):.3f} |"
            f" {max(walk['sunk_m'] for walk in own):.3f} |"
        )


def _gaits(name: str) -> list[str]:
    robot = load_robot(name)
    return [each for each in walking_controllers(robot) if isinstance(load_policy(each, robot), Walk)]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", default=",".join(available_robots()))
    parser.add_argument("--gaits", default="", help="A,B: only these gaits of each robot")
    parser.add_argument("--seeds", type=int, default=5, help="walks of each gait")
    add_options(parser)
    options = parser.parse_args()
    chosen = [name for name in options.gaits.split(",") if name]
    trials = [
        Trial(robot, gait, seed)
        for robot in options.robots.split(",")
        for gait in _gaits(robot)
        if not chosen or gait in chosen
        for seed in range(options.seeds)
    ]
    walks, errors = run_resumable(walk, trials, options.out, options.workers, options.time_limit)
    for line in [*table(walks), *errors]:
        print(line)


if __name__ == "__main__":
    main()
