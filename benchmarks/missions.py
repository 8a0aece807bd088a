"""How well missions close: a rectangle of 2 by 1 m by odometry, then the true place against the start.

    python benchmarks/missions.py --workers 16 --out missions.jsonl

Each learned policy and one walking controller of each kind, on the nominal plant and on randomised ones, over
the simulated bus with the scenarios' sensor noise. Prints a table.
"""

import argparse
import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from resumable_runs import add_options, run_resumable

from footfall.common.rotations import heading, heading_matrix, wrap_angle
from footfall.deploy.config import deploy_config
from footfall.deploy.loop import ControlLoop
from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import draw
from footfall.evaluate.scenarios import load_scenarios
from footfall.operate.abilities import abilities_of
from footfall.operate.missions.mission import mission_of
from footfall.operate.missions.source import DONE, MissionSource
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import first_of_each_kind, load_policy, walking_controllers, zoo_names
from footfall.robots.description import available_robots, load_robot
from footfall.robots.model import plant_model

LONGEST_S = 600.0
GOAL_M = 0.10
PLANTS = ("nominal", "randomised")


class Trial(NamedTuple):
    """One mission."""

    robot: str
    policy: str
    plant: str
    size: str
    seed: int
    speed_m_s: float | None = None  # None for the mission's default


class TruePose:
    """The true pose where the mission begins and where it is over."""

    def __init__(self, source: MissionSource) -> None:
        self._source = source
        self.begin: tuple[np.ndarray, float] | None = None
        self.end: tuple[np.ndarray, float] | None = None
        self.lap_s = math.nan

    def __call__(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        """After each joint tick."""
        over = self._source.progress.outcome
        if self.end is not None or not (over or (loop.walking and self.begin is None)):
            return
        truth = body.truth()
        here = truth.base_position[:2].copy(), float(heading(truth.base_quaternion))
        if self.begin is None:
            self.begin = here
        else:
            self.end, self.lap_s = here, loop.walking_s


def walk(trial: Trial) -> dict[str, Any]:
    """One mission and its figures."""
    robot = load_robot(trial.robot)
    policy = load_policy(trial.policy, robot)
    speed = {} if trial.speed_m_s is None else {"speed_m_s": trial.speed_m_s}
    mission = mission_of({**speed, "steps": [{"rectangle": trial.size}]}, "rectangle")
    source = MissionSource(mission, policy.name, abilities_of({trial.policy: policy}, robot))
    poses = TruePose(source)
    sample = None
    if trial.plant == "randomised":
        rng = np.random.default_rng(trial.seed)
        bodies = plant_model(robot).nbody - 1
        sample = draw(randomisation_of(robot), rng.random, len(robot.joint_names), bodies, robot.foot_sensors)
    episode = Episode(
        command_source=source,
        duration_s=LONGEST_S,
        seed=trial.seed,
        sample=sample,
        noise=load_scenarios(robot).noise,
        record=False,
        config=replace(deploy_config(robot), odometry=True),
    )
    trace = run_episode(robot, policy, episode, poses)
    found = {**trial._asdict(), "fell": trace.fell, "outcome": source.progress.outcome, "lap_s": poses.lap_s}
    if poses.begin is None or poses.end is None:
        return found
    (place, yaw), (last, last_yaw) = poses.begin, poses.end
    off = heading_matrix(-yaw)[:2, :2] @ (last - place)
    return {
        **found,
        "closing_m": float(np.hypot(*off)),
        "odometry_closing_m": source.progress.error_m,
        "turned_deg": math.degrees(wrap_angle(last_yaw - yaw)),
    }


def table(trials: list[dict[str, Any]]) -> Iterator[str]:
    """A row for each policy and plant, in Markdown."""
    yield (
        "| robot | policy | plant | done | falls | closes, m: median, worst | by odometry: worst |"
        " turned, degrees: worst | lap, s |"
    )
    yield "|" + " --- |" * 9
    for key in dict.fromkeys((each["robot"], each["policy"], each["plant"]) for each in trials):
        own = [each for each in trials if (each["robot"], each["policy"], each["plant"]) == key]
        done = [each for each in own if each["outcome"] == DONE and not each["fell"]]
        closing = [each["closing_m"] for each in done] or [math.nan]
        yield (
            f"| {' | '.join(key)} | {len(done)} of {len(own)} | {sum(each['fell'] for each in own)} |"
            f" {np.median(closing):.3f}, {max(closing):.3f} |"
            f" {max((each['odometry_closing_m'] for each in done), default=math.nan):.3f} |"
            f" {max((abs(each['turned_deg']) for each in done), default=math.nan):.1f} |"
            f" {np.median([each['lap_s'] for each in done] or [math.nan]):.0f} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", default=",".join(available_robots()))
    parser.add_argument("--policies", default="", help="A,B: these (default: learned ones, one of each kind)")
    parser.add_argument("--plants", default=",".join(PLANTS))
    parser.add_argument("--size", default="2x1", help="of the rectangle, m")
    parser.add_argument("--speed", type=float, help="m/s (default: half of the highest command)")
    parser.add_argument("--seeds", type=int, default=5, help="missions of each kind")
    add_options(parser)
    options = parser.parse_args()
    wanted = [name for name in options.policies.split(",") if name]
    trials = [
        Trial(name, policy, plant, options.size, seed, options.speed)
        for seed in range(options.seeds)  # first, so that a run that is stopped has some of each kind
        for name in options.robots.split(",")
        for policy in _policies(name, wanted)
        for plant in options.plants.split(",")
    ]
    found, errors = run_resumable(walk, trials, options.out, options.workers, options.time_limit)
    print("\n".join([*table(found), *errors]))
    reached = [each for each in found if each.get("closing_m", math.inf) <= GOAL_M]
    print(f"{len(reached)} of {len(found)} close within {GOAL_M:g} m")


def _policies(name: str, wanted: list[str]) -> list[str]:
    robot = load_robot(name)
    if wanted:
        return [each for each in (*zoo_names(robot), *walking_controllers(robot)) if each in wanted]
    return [*zoo_names(robot), *first_of_each_kind(walking_controllers(robot))]


if __name__ == "__main__":
    main()
