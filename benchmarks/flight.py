"""Flight phases and jumps of controllers on randomised robots, from ground truth.

    python benchmarks/flight.py jump --robots 100 --workers 2 [--out FILE.jsonl]
    python benchmarks/flight.py pronk --robots 20

Robots that are already in FILE are not simulated again: the same command continues an interrupted run.

`jump` gets a forward command for 1.2 s, which makes one jump; the episode lasts 2 s longer. A jump counts
if the base rises by 0.15 m, the robot then stands 0.4 m ahead of its start, and it neither falls nor has a
fault. Gaits get 0.6 m/s straight ahead and are evaluated from 1 s on. Forces are contact forces. Torques
are relative to each motor's peak.
"""

import argparse
import json
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np

from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import draw
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, run_episode
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot
from footfall.robots.mjcf import load_spec

RISE_M, AHEAD_M = 0.15, 0.4
STANDS_S, JUMP_UNTIL_S, JUMP_S = 0.6, 1.2, 3.2
GAIT_M_S, GAIT_FROM_S, GAIT_S = 0.6, 1.0, 10.0


@dataclass
class Result:
    """One episode."""

    seed: int
    fell: bool
    stopped: bool  # by the supervisor, without a fall
    flight: float  # share of the time without any foot on the ground
    rise_m: float  # largest rise of the base above its initial height
    ahead_m: float  # final horizontal distance from the start
    feet_m: float  # largest height of the lowest foot
    force_n: float  # largest contact force of a foot
    torque: float  # largest motor torque, relative to its peak

    @property
    def jumped(self) -> bool:
        """Whether the robot made the commanded jump."""
        return not (self.fell or self.stopped) and self.rise_m >= RISE_M and self.ahead_m >= AHEAD_M


def simulate(robot_name: str, controller: str, seed: int) -> Result:
    """Result of the randomised robot of a seed."""
    robot = load_robot(robot_name)
    jumps = controller.startswith("jump")
    speed, until_s = (0.5, JUMP_UNTIL_S) if jumps else (GAIT_M_S, GAIT_S)
    bodies = load_spec(robot.xml_path).compile().nbody - 1
    joints = len(robot.joint_names)
    episode = Episode(
        command_source=lambda time_s: np.array([speed * (time_s < until_s), 0.0, 0.0]),
        duration_s=JUMP_S if jumps else GAIT_S,
        seed=seed,
        sample=draw(randomisation_of(robot), np.random.default_rng(seed).random, joints, bodies),
        noise=load_scenarios(robot).noise,
        record_rate_hz=500.0,
    )
    trace = run_episode(robot, load_policy(controller, robot), episode)
    begin = int(np.searchsorted(trace.time_s, STANDS_S if jumps else GAIT_FROM_S))
    if begin >= len(trace.time_s):
        return Result(seed, trace.fell, not trace.fell, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    travel = trace.base_position[begin:] - trace.base_position[begin]
    feet = trace.foot_position[begin:, :, 2]
    return Result(
        seed,
        fell=trace.fell,
        stopped=bool(trace.faults) and not trace.fell,
        flight=float((~trace.foot_contact[begin:].any(axis=1)).mean()),
        rise_m=float(travel[:, 2].max()),
        ahead_m=float(np.hypot(travel[-1, 0], travel[-1, 1])),
        feet_m=float(feet.min(axis=1).max() - feet.min()),
        force_n=float(trace.foot_force[begin:].max()),
        torque=float((np.abs(trace.motor_torque[begin:]) / robot.motor.peak_torque).max()),
    )


def measured(
    measure: Callable[[int], Result], seeds: Iterable[int], workers: int, path: Path | None
) -> list[Result]:
    """Results of all seeds; results in the file at `path` are read, the others are appended to it."""
    known = [] if path is None or not path.exists() else path.read_text().splitlines()
    results = {result.seed: result for result in (Result(**json.loads(line)) for line in known)}
    with ProcessPoolExecutor(workers) as pool:
        for result in pool.map(measure, [seed for seed in seeds if seed not in results]):
            results[result.seed] = result
            if path is not None:
                with path.open("a") as lines:
                    lines.write(json.dumps(asdict(result)) + "\n")
    return [results[seed] for seed in seeds]


def main() -> None:
    """Measure, and print medians, minima and maxima."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("controller")
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--robots", type=int, default=20, help="number of randomised robots")
    parser.add_argument("--seed", type=int, default=4711)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument(
        "--out", type=Path, help="file for a line of JSON for each robot, as soon as it is done"
    )
    options = parser.parse_args()
    results = measured(
        partial(simulate, options.robot, options.controller),
        range(options.seed, options.seed + options.robots),
        options.workers,
        options.out,
    )
    for name in ("fell", "stopped", *(["jumped"] if options.controller.startswith("jump") else [])):
        print(f"{name:10} {sum(getattr(each, name) for each in results)} of {len(results)}")
    for name in ("flight", "rise_m", "ahead_m", "feet_m", "force_n", "torque"):
        values = np.array([getattr(each, name) for each in results])
        print(f"{name:10} {np.median(values):.3f} ({values.min():.3f} to {values.max():.3f})")


if __name__ == "__main__":
    main()
