"""Drift of the base estimator's odometry, and consistency of its covariance.

    python benchmarks/odometry.py --workers 16 --out odometry.jsonl --plot odometry.png
    python benchmarks/odometry.py --read odometry.jsonl --plot odometry.png

Each walking controller and learned policy of each robot walks straight, along a curve and around a rectangle,
on the nominal plant and on randomised ones, with the scenarios' sensor noise. A `BaseEstimator` gets the
loop's readings and the policy's contact plan. Its last pose is compared with the true one, both relative to
the start of the walk. Seeds begin at 1000, because the estimator's settings were chosen on smaller seeds.
Prints a table.
"""

import argparse
import math
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from resumable_runs import add_options, read_runs, run_resumable

from footfall.common.rotations import heading, heading_matrix, wrap_angle
from footfall.deploy.estimation.config import EstimatorConfig, OdometryConfig
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import MOVING
from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import draw
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.policy import Policy
from footfall.policies.registry import load_policy, walking_controllers, zoo_names
from footfall.robots.commands import CommandRange
from footfall.robots.description import available_robots, load_robot
from footfall.robots.model import plant_model

FIRST_SEED = 1000
RECORD_EVERY_S = 0.237  # no multiple of a gait period: errors oscillate with the stride
COMMAND_SHARE = 0.5  # share of the robot's highest commands
SIDE_S = 3.0  # duration of one side of the rectangle
PARTS = {"horizontal position": [0, 1], "height": [2], "yaw": [3], "horizontal velocity": [4, 5]}
PLANTS = ("nominal", "randomised")
GOAL = 2.0  # largest drift, % of the distance
LONG_ENOUGH_M = 0.5  # drift per distance is not computed for shorter paths


class Walk(NamedTuple):
    """One episode."""

    robot: str
    policy: str
    path: str
    plant: str
    seed: int
    duration_s: float  # duration of a straight walk or a curve
    scale_error: float | None


class Course:
    """Commands over time, (3,) each."""

    def __init__(self, name: str, commands: CommandRange, duration_s: float) -> None:
        forward, yaw = COMMAND_SHARE * commands.forward_m_s[1], COMMAND_SHARE * commands.yaw_rad_s[1]
        quarter_s = math.pi / 2 / yaw
        self.parts = {
            "straight": [(duration_s, forward, 0.0)],
            "curve": [(duration_s, forward, 0.5 * yaw)],
            "rectangle": [(SIDE_S, forward, 0.0), (quarter_s, 0.0, yaw)] * 4,
        }[name]
        self.duration_s = sum(part[0] for part in self.parts)

    def __call__(self, time_s: float) -> np.ndarray:
        for part_s, forward, yaw in self.parts:
            if time_s < part_s:
                return np.array([forward, 0.0, yaw])
            time_s -= part_s
        return np.zeros(3)


class EstimatorRecorder:
    """Runs an estimator beside the loop; records its odometry and the true pose every `RECORD_EVERY_S`."""

    def __init__(self, policy: Policy, estimator: BaseEstimator) -> None:
        self._policy, self._estimator = policy, estimator
        self._now_us: int | None = None
        self._next_record_s = 0.0
        self._plan: np.ndarray | None = None  # plan of the previous tick
        self.rows: list[dict[str, Any]] = []

    def __call__(self, loop: ControlLoop, body: SimulatedRobot) -> None:
        """Update the estimator; called after each joint tick."""
        if loop.state.mode not in MOVING:
            return
        if self._now_us is None:
            self._estimator.reset(loop.sensed)
        else:
            self._estimator.update(loop.sensed, self._plan, (loop.now_us - self._now_us) * 1e-6)
        self._now_us = loop.now_us
        if not loop.walking:
            return
        if not self.rows:
            self._estimator.start()
            self._start_position, quaternion = body.truth().base_position, body.truth().base_quaternion
            self._start_yaw = float(heading(quaternion))
        self._plan = self._policy.stance()
        if loop.walking_s >= self._next_record_s:
            self._next_record_s += RECORD_EVERY_S
            self._record(loop.walking_s, body)

    def _record(self, time_s: float, body: SimulatedRobot) -> None:
        truth, odometry = body.truth(), self._estimator.odometry()
        true_position = heading_matrix(-self._start_yaw) @ (truth.base_position - self._start_position)
        true_yaw = wrap_angle(float(heading(truth.base_quaternion)) - self._start_yaw)
        self.rows.append(
            {
                "time_s": time_s,
                "true": true_position.tolist(),
                "estimated": odometry.position.tolist(),
                "error": [
                    *(odometry.position - true_position).tolist(),
                    wrap_angle(odometry.yaw - true_yaw),
                    *(odometry.velocity - truth.base_velocity).tolist(),
                ],
                "sigma": np.sqrt(np.diag(odometry.covariance)).tolist(),
            }
        )


def follow(walk: Walk) -> dict[str, Any]:
    """Run one walk; returns its drift and the recorded errors."""
    robot = load_robot(walk.robot)
    policy = load_policy(walk.policy, robot)
    commands = robot.description.commands
    config = EstimatorConfig()
    if walk.scale_error is not None:
        config = replace(config, odometry=OdometryConfig(scale_error=walk.scale_error))
    recorder = EstimatorRecorder(policy, BaseEstimator(robot, config))
    path = Course(walk.path, commands, walk.duration_s)
    sample = None
    if walk.plant == "randomised":
        rng = np.random.default_rng(walk.seed)
        bodies = plant_model(robot).nbody - 1
        sample = draw(randomisation_of(robot), rng.random, len(robot.joint_names), bodies, robot.foot_sensors)
    episode = Episode(
        command_source=path,
        duration_s=path.duration_s,
        seed=walk.seed,
        sample=sample,
        noise=load_scenarios(robot).noise,
        record=False,
    )
    trace = run_episode(robot, policy, episode, recorder)
    true = np.array([row["true"] for row in recorder.rows])
    distance = float(np.linalg.norm(np.diff(true[:, :2], axis=0), axis=1).sum())
    error = float(np.linalg.norm(recorder.rows[-1]["error"][:2]))
    return {
        **walk._asdict(),
        "fell": trace.fell,
        "distance_m": distance,
        "error_m": error,
        "drift_percent": 100.0 * error / distance if distance > LONG_ENOUGH_M else None,
        "rows": recorder.rows,
    }


def within_two_sigma(walks: Iterable[dict[str, Any]]) -> dict[str, float]:
    """Share of the errors within two standard deviations, by part of the pose; 0.954 for Gaussian errors."""
    rows = [row for walk in walks for row in walk["rows"][1:]]
    if not rows:
        return {}
    error, sigma = (np.array([row[key] for row in rows]) for key in ("error", "sigma"))
    inside = np.abs(error) <= 2.0 * sigma
    return {name: float(inside[:, columns].mean()) for name, columns in PARTS.items()}


def summary(walks: list[dict[str, Any]]) -> dict[str, Any]:
    """Drift and covariance of some walks; those that fell or hardly moved are only counted."""
    counted = [walk for walk in walks if not walk["fell"] and walk["drift_percent"] is not None]
    drift = np.array([walk["drift_percent"] for walk in counted])
    figures = {"walks": len(walks), "fell": sum(walk["fell"] for walk in walks), "counted": len(counted)}
    if counted:
        figures |= {
            "drift_percent_median": float(np.median(drift)),
            "drift_percent_p95": float(np.percentile(drift, 95)),
            "drift_percent_max": float(drift.max()),
            "share_below_goal": float((drift <= GOAL).mean()),
            "distance_m": float(np.mean([walk["distance_m"] for walk in counted])),
        }
    return {**figures, "within_two_sigma": within_two_sigma(counted)}


def table(walks: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """A summary for each robot, policy and plant, and one of all walks for each plant."""
    keys = sorted({(walk["robot"], walk["policy"], walk["plant"]) for walk in walks})
    rows = []
    for plant in PLANTS:
        for key in [key for key in keys if key[2] == plant]:
            own = [walk for walk in walks if (walk["robot"], walk["policy"], walk["plant"]) == key]
            rows.append({"robot": key[0], "policy": key[1], "plant": plant, **summary(own)})
        own = [walk for walk in walks if walk["plant"] == plant]
        if own:
            rows.append({"robot": "all", "policy": "all", "plant": plant, **summary(own)})
    return rows


def print_table(rows: list[dict[str, Any]]) -> None:
    """Print the table, in Markdown."""
    print(
        "| robot | policy | plant | walks (fell) | distance, m | drift: median, p95, max, % |"
        " within 2 sigma |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for row in rows:
        inside = ", ".join(f"{name} {share:.2f}" for name, share in row["within_two_sigma"].items())
        drift = [row.get(f"drift_percent_{key}", math.nan) for key in ("median", "p95", "max")]
        print(
            f"| {row['robot']} | {row['policy']} | {row['plant']} | {row['walks']} ({row['fell']}) |"
            f" {row.get('distance_m', math.nan):.1f} |"
            f" {', '.join(f'{value:.2f}' for value in drift)} | {inside} |"
        )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--robots", default=",".join(available_robots()))
    parser.add_argument("--policies", default="", help="comma-separated names (default: all of each robot)")
    parser.add_argument("--paths", default="straight,curve,rectangle")
    parser.add_argument("--plants", default=",".join(PLANTS))
    parser.add_argument("--seeds", type=int, default=10, help="walks per kind")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument(
        "--duration", type=float, default=20.0, help="duration of straight walks and curves, s"
    )
    parser.add_argument("--scale-error", type=float, help="replaces the estimator's setting")
    add_options(parser)
    parser.add_argument("--read", type=Path, help="file written by --out: nothing is run")
    parser.add_argument("--plot", type=Path, help="image to write")
    options = parser.parse_args()

    if options.read is not None and not read_runs(options.read):
        parser.error(f"{options.read} has no walks")
    walks, errors = (list(read_runs(options.read).values()), []) if options.read else run(options)
    print_table(table(walks))
    for error in errors:
        print(error)
    if options.plot is not None:
        from odometry_plot import plot

        try:
            plot(walks, GOAL, options.plot)
        except ValueError as error:
            parser.error(str(error))


def run(options: argparse.Namespace) -> tuple[list[dict[str, Any]], list[str]]:
    """All requested walks, and a line for each that failed."""
    chosen = [name for name in options.policies.split(",") if name]
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    walks = [
        Walk(name, policy, path, plant, seed, options.duration, options.scale_error)
        for seed in seeds  # outermost, so that an interrupted run has results of each kind
        for name in options.robots.split(",")
        for policy in (*walking_controllers(load_robot(name)), *zoo_names(load_robot(name)))
        if not chosen or policy in chosen
        for path in options.paths.split(",")
        for plant in options.plants.split(",")
    ]
    return run_resumable(follow, walks, options.out, options.workers, options.time_limit)


if __name__ == "__main__":
    main()
