"""Computing time of the MPC: build and solve of its quadratic program, and all of `act`.

Run on one core: OMP_NUM_THREADS=1 taskset -c 0 python benchmarks/mpc_compute.py
"""

import argparse
import time
from functools import partial

import numpy as np

from footfall.plant.episode import Episode, run_episode
from footfall.policies.controllers.mpc import Mpc
from footfall.robots.description import load_robot


def command_at(commands: np.ndarray, time_s: float) -> np.ndarray:
    """A new command every four seconds."""
    row: np.ndarray = commands[int(time_s // 4)]
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--episodes", type=int, default=5)
    parser.add_argument("--duration", type=float, default=20.0, help="duration of each episode, s")
    arguments = parser.parse_args()

    robot = load_robot(arguments.robot)
    solve_ms: list[float] = []
    act_ms: list[float] = []
    fallbacks = 0
    began = time.perf_counter()
    for seed in range(arguments.episodes):
        rng = np.random.default_rng(seed)
        commands = rng.uniform(-1, 1, (100, 3)) * np.array([1.0, 0.5, 1.0])
        policy = Mpc(robot)
        command = partial(command_at, commands)
        episode = Episode(command_source=command, duration_s=arguments.duration, seed=seed)
        trace = run_episode(robot, policy, episode)
        solve_ms += list(policy.solve_ms)
        act_ms += list(np.ravel(trace.compute_ms))
        fallbacks += policy.fallbacks
    wall_s = time.perf_counter() - began

    simulated_s = arguments.episodes * arguments.duration
    print(f"{len(solve_ms)} solves in {simulated_s:g} s, {fallbacks} of them by the fallback")
    for name, values in (("build and solve", solve_ms), ("act at the joint rate", act_ms)):
        p50, p99, worst = np.percentile(values, [50, 99, 100])
        print(f"{name:22s} p50 {p50:.3f} ms  p99 {p99:.3f} ms  max {worst:.3f} ms")
    print(f"full loop: {simulated_s / wall_s:.1f} x real time")


if __name__ == "__main__":
    main()
