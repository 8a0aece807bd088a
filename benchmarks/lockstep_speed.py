"""Speed of the full loop in lockstep relative to real time, including frames, joint law and physics.

    python benchmarks/lockstep_speed.py [--policy stand] [--seconds 20]

Prints a JSON object. `cpu` divides simulated time by CPU time, which other work on the machine hardly
affects; `wall` divides by wall-clock time.
"""

import argparse
import json
import time

import numpy as np

from footfall.plant.episode import Episode, run_episode
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot


def measure(robot_name: str, policy_name: str, seconds: float) -> dict[str, float]:
    """One run of a policy that walks forward at 0.5 m/s."""
    robot = load_robot(robot_name)
    policy = load_policy(policy_name, robot)
    command = np.array([0.5, 0.0, 0.0])
    began = time.process_time()
    trace = run_episode(robot, policy, Episode(command_source=lambda _: command, duration_s=seconds))
    cpu_s = time.process_time() - began
    return {
        "simulated_s": trace.run_s,
        "wall": trace.run_s / trace.wall_s,
        "cpu": trace.run_s / cpu_s,
        "tick_us_p50": trace.timing["tick_us_p50"],
        "tick_us_p99": trace.timing["tick_us_p99"],
        "policy_ms_p50": trace.timing["policy_ms_p50"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--policy", default="stand")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    runs = [measure(options.robot, options.policy, options.seconds) for _ in range(options.runs)]
    best = max(runs, key=lambda run: run["cpu"])
    print(json.dumps({"policy": options.policy, **{key: round(value, 3) for key, value in best.items()}}))


if __name__ == "__main__":
    main()
