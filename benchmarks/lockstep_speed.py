"""Speed of the full loop in lockstep relative to real time, including frames, joint law and physics.

    python benchmarks/lockstep_speed.py [--policy stand] [--seconds 20] [--cycle 20]

Prints a JSON object. `cpu` divides simulated time by CPU time, which other work on the machine hardly
affects; `wall` divides by wall-clock time. With `--cycle N` it also prints the mean time, us, of the ticks at
each place in a cycle of N ticks, each tick as fast as in its fastest run: 20 ticks for a window of the sensor
checks, 10 for a step of go1-flat, 5 for a sample of the trace.
"""

import argparse
import json
import time

import numpy as np

from footfall.deploy.loop import ControlLoop
from footfall.plant.episode import Episode, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot


def measure(robot_name: str, policy_name: str, seconds: float) -> tuple[dict[str, float], np.ndarray]:
    """One run of a policy that walks at 0.5 m/s: its speeds, and the end of each tick of the walk, s."""
    robot = load_robot(robot_name)
    policy = load_policy(policy_name, robot)
    command = np.array([0.5, 0.0, 0.0])
    ends_s: list[float] = []

    def watch(loop: ControlLoop, _: SimulatedRobot) -> None:
        if loop.walking:
            ends_s.append(time.perf_counter())

    began = time.process_time()
    trace = run_episode(robot, policy, Episode(command_source=lambda _: command, duration_s=seconds), watch)
    cpu_s = time.process_time() - began
    speeds = {
        "simulated_s": trace.run_s,
        "wall": trace.run_s / trace.wall_s,
        "cpu": trace.run_s / cpu_s,
        "tick_us_p50": trace.timing["tick_us_p50"],
        "tick_us_p99": trace.timing["tick_us_p99"],
        "policy_ms_p50": trace.timing["policy_ms_p50"],
    }
    return speeds, np.array(ends_s)


def cycle_us(ends_s: list[np.ndarray], cycle: int) -> list[int]:
    """Mean time of the ticks at each place in a cycle, us, from when ticks ended in several equal runs, s."""
    fastest_s = np.min([np.diff(run) for run in ends_s], axis=0)
    whole = len(fastest_s) // cycle * cycle
    return np.rint(1e6 * fastest_s[:whole].reshape(-1, cycle).mean(axis=0)).astype(int).tolist()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="go1")
    parser.add_argument("--policy", default="stand")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--cycle", type=int, help="ticks of a cycle whose mean times are printed, too")
    options = parser.parse_args()
    runs = [measure(options.robot, options.policy, options.seconds) for _ in range(options.runs)]
    best = max((speeds for speeds, _ in runs), key=lambda speeds: speeds["cpu"])
    found = {"policy": options.policy, **{key: round(value, 3) for key, value in best.items()}}
    if options.cycle:
        found["cycle_us"] = cycle_us([ends_s for _, ends_s in runs], options.cycle)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
