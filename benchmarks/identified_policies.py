"""Policies trained on wide, identified and true ranges, walking on the same hidden robot.

    python benchmarks/identified_policies.py prepare --out robots_of_study
    footfall train --robot robots_of_study/wide --preset gpu --out wide        # then identified, true
    python benchmarks/identified_policies.py judge wide identified true --robots robots_of_study --workers 16

`prepare` draws a hidden robot from `HIDDEN` and records it twice on a stand, by the code of
`footfall identify record`. `footfall identify fit` proposes a robot folder; the second recording is held out.
Three folders result:

    wide        the nominal robot, with ranges that contain every robot of `HIDDEN`
    identified  the proposal of the fit
    true        the hidden robot's own parameters; each range spans the values of its joints

`judge` runs each policy on the hidden robot: the same commands, ground friction and pushes for all of them.
`compared_policies.py` compares the walks that `judge --walks` writes.
"""

import argparse
import json
import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import yaml
from identification import FITTED_MOTION, HELD_OUT_MOTION, recorded, true_parameters, truth_of

from footfall.cli import main as footfall
from footfall.common.config import unstructure
from footfall.common.outputs import write_json, write_text
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import OWN_FILE, Randomisation
from footfall.domain_rand.sample import Sample
from footfall.evaluate.metrics import EpisodeMetrics, score
from footfall.evaluate.plan import EpisodePlan, plan_episodes
from footfall.evaluate.scenarios import ScenarioFile, load_scenarios
from footfall.identify.fit import Estimate, LegFit, Track
from footfall.identify.leg import fixed_legs
from footfall.identify.parameters import Parameter
from footfall.identify.proposal import propose
from footfall.plant.episode import Episode, run_episode
from footfall.policies.registry import load_policy
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import plant_model

ROBOT = "go1"
HIDDEN = Randomisation(
    armature=Distribution(1.1, 1.8),
    joint_friction=Distribution(1.5, 3.0),
    joint_damping=Distribution(0.05, 0.2),
    torque_lag_s=Distribution(0.002, 0.006),
    action_delay_s=Distribution(0.004, 0.008),
    encoder_bias=Distribution(-0.02, 0.02),
    motor_strength=Distribution(0.75, 0.9),
    kp=Distribution(0.85, 0.95),
    kd=Distribution(0.8, 1.0),
    link_mass=Distribution(0.95, 1.15),
)
WIDE = Randomisation(
    armature=Distribution(0.8, 2.0),
    joint_friction=Distribution(0.5, 3.5),
    joint_damping=Distribution(0.0, 0.25),
    torque_lag_s=Distribution(0.0, 0.008),
    action_delay_s=Distribution(0.0, 0.015),
    encoder_bias=Distribution(-0.03, 0.03),
    motor_strength=Distribution(0.7, 1.1),
    kp=Distribution(0.8, 1.1),
    kd=Distribution(0.7, 1.2),
    link_mass=Distribution(0.85, 1.2),
)
GROUND_FRICTION = (0.4, 1.25)
SCENARIOS = {"nominal": 48, "push": 104}
WIDE_NAME, IDENTIFIED, TRUE = "wide", "identified", "true"


@cache
def hidden(number: int) -> Sample:
    """The hidden robot's parameters, relative to the nominal robot."""
    return true_parameters(load_robot(ROBOT), number, HIDDEN, seed=320)


def prepare(number: int, out: Path) -> None:
    """Record, fit, and write the three robot folders."""
    robot, sample = load_robot(ROBOT), hidden(number)
    out.mkdir(parents=True)
    fitted = recorded(robot, sample, FITTED_MOTION, 0, out)
    recorded(robot, sample, HELD_OUT_MOTION, 1, out)
    write_ranges(propose(robot, [], [], out / WIDE_NAME), WIDE)
    fits = []
    for leg in fixed_legs(robot):
        truth = truth_of(robot, leg, sample, fitted)
        estimates = [Estimate(Parameter(*key), value, value, value) for key, value in truth.items()]
        zeros = np.zeros(leg.count)
        fits.append(LegFit(leg, tuple(estimates), {}, zeros, zeros, Track(*(zeros,) * 4), zeros))
    write_ranges(propose(robot, fits, [], out / TRUE), _ranges_over_joints(sample))
    logs = [str(out / f"{seed}.mcap") for seed in (0, 1)]
    status = footfall(
        [
            *("identify", "fit", logs[0], "--held-out", logs[1], "--out", str(out / IDENTIFIED)),
            *("--json", str(out / "fit.json"), "--robot", ROBOT),
        ]
    )
    print(f"exit status of the fit: {status}")
    for log in logs:
        Path(log).unlink()


def _ranges_over_joints(sample: Sample) -> Randomisation:
    """Ranges over the values of a sample's joints.

    Quantities that the folder's MJCF holds are nominal.
    """
    nominal = {name: Distribution(1.0, 1.0) for name in ("armature", "joint_friction", "link_mass")}
    nominal["joint_damping"] = Distribution(0.0, 0.0)
    spread = {
        name: Distribution(float(np.min(values)), float(np.max(values)))
        for name, values in sample.items()
        if name not in nominal
    }
    return Randomisation(**nominal | spread)


def write_ranges(folder: Path, ranges: Randomisation) -> None:
    """The folder's randomisation.yaml."""
    declared = {name: value for name, value in unstructure(ranges).items() if value is not None}
    write_text(folder / OWN_FILE, yaml.safe_dump(declared))


Task = tuple[str, str, int, EpisodePlan]  # policy, robot folder, number of the hidden robot, episode


def run(task: Task) -> EpisodeMetrics:
    """One episode on the hidden robot."""
    policy, folder, number, plan = task
    robot = with_nominal_losses(folder)
    rng = np.random.default_rng(plan.seed)
    sample = hidden(number) | {"friction": rng.uniform(*GROUND_FRICTION)}
    episode = Episode(
        command_source=plan.schedule,
        duration_s=plan.duration_s,
        seed=plan.seed,
        plant=load_robot(ROBOT).xml_path,  # the sample holds differences from this body
        sample=sample,
        noise=_scenarios().noise,
        pushes=plan.pushes,
    )
    trace = run_episode(robot, load_policy(policy, robot), episode)
    return score(trace, robot, 9.81 * float(plant_model(load_robot(ROBOT)).body_mass.sum()))


@cache
def _scenarios() -> ScenarioFile:
    return load_scenarios(load_robot(ROBOT))


@cache
def with_nominal_losses(folder: str) -> Robot:
    """The robot of a folder with the losses of the nominal motors, from which the hidden robot differs.

    The nominal MJCF has no damping. Without this, the folder's would be added to the hidden robot's.
    """
    robot, nominal = load_robot(folder), load_robot(ROBOT)
    motor = robot.motor._replace(friction=nominal.motor.friction, damping=nominal.motor.damping)
    return replace(robot, motor=motor)


def judge(
    policies: list[Path],
    robots: Path,
    number: int,
    workers: int,
    episodes: dict[str, int],
    out: Path | None,
    walks: Path | None,
) -> None:
    """Run all episodes and print the table."""
    rows: list[dict] = []
    with ProcessPoolExecutor(workers) as pool:
        for name, count in episodes.items():
            plans = plan_episodes(name, _scenarios().scenarios[name], 0, count)
            for policy in policies:
                kind = policy.name.partition("-")[0]
                tasks = [(str(policy), str(robots / kind), number, plan) for plan in plans]
                found = list(pool.map(run, tasks))
                rows.append(row_of(policy.name, name, found))
                print(json.dumps(rows[-1]), flush=True)
                write_json(out, rows)
                if walks:
                    key = {"policy": policy.name, "scenario": name}
                    lines = [key | {"index": i} | asdict(each) for i, each in enumerate(found)]
                    with walks.open("a") as file:
                        file.writelines(json.dumps(line) + "\n" for line in lines)


def row_of(policy: str, scenario: str, found: list[EpisodeMetrics]) -> dict:
    """A policy's tracking, energy and falls, over the time that it walked."""
    scored = np.array([each.scored_s for each in found])

    def rms(name: str) -> float:
        squares = np.array([getattr(each, name) for each in found])
        known = np.isfinite(squares) & (scored > 0.0)
        return math.sqrt(float(np.average(squares[known], weights=scored[known])))

    distance = sum(each.distance_m for each in found)
    return {
        "policy": policy,
        "scenario": scenario,
        "episodes": len(found),
        "fell": sum(each.fell for each in found),
        "velocity_error_m_s": rms("lin_vel_mse"),
        "yaw_error_rad_s": rms("yaw_rate_mse"),
        "cost_of_transport": sum(each.electrical_j / each.weight_n for each in found) / distance,
        "foot_slip_m_s": float(np.nanmean([each.foot_slip_m_s for each in found])),
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--hidden", type=int, default=0, help="number of the hidden robot")
    verbs = parser.add_subparsers(dest="verb", required=True)
    prepare_parser = verbs.add_parser("prepare", help="record, fit and write robot folders")
    prepare_parser.add_argument("--out", type=Path, required=True, help="folder; it must not exist")
    judge_parser = verbs.add_parser("judge", help="run policies on the hidden robot")
    judge_parser.add_argument(
        "policies", type=Path, nargs="+", help="run folders, named wide, identified-2, …"
    )
    judge_parser.add_argument("--robots", type=Path, required=True, help="folder that `prepare` wrote")
    judge_parser.add_argument("--workers", type=int, default=1)
    judge_parser.add_argument("--json", type=Path)
    judge_parser.add_argument("--walks", type=Path, help="append each walk, for `compared_policies.py`")
    for name, count in SCENARIOS.items():
        judge_parser.add_argument(f"--{name}", type=int, default=count, help=f"number of walks, {count}")
    options = parser.parse_args()
    if options.verb == "prepare":
        prepare(options.hidden, options.out)
    else:
        judge(
            options.policies,
            options.robots,
            options.hidden,
            options.workers,
            {name: getattr(options, name) for name in SCENARIOS},
            options.json,
            options.walks,
        )


if __name__ == "__main__":
    main()
