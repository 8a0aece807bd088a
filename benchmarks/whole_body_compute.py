"""Computing time of whole-body control: python benchmarks/whole_body_compute.py [--ticks 2000].

One core: keep OMP_NUM_THREADS=1. A tick is dynamics, build and solve, on a robot that sways and is pushed:
    `balance` on all feet, `step` while walking (mostly on one foot), and `mpc-wbc` while trotting, which
    computes new forces in one of five ticks.
"""

import argparse
import time

import numpy as np

from footfall.policies.controllers.balance import Balance
from footfall.policies.controllers.mpc.whole_body import MpcWholeBody
from footfall.policies.controllers.step import Step
from footfall.policies.policy import PolicyInput, Sensed
from footfall.robots.description import load_robot

CASES = ((Balance, "g1"), (Step, "g1"), (MpcWholeBody, "go1"))
UNTIMED = 10  # number of first ticks without timing


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ticks", type=int, default=2000)
    options = parser.parse_args()
    for kind, name in CASES:
        robot = load_robot(name)
        policy = kind(robot)
        n, height = len(robot.joint_names), robot.description.standing_height_m
        rng, act_ms = np.random.default_rng(0), []
        for tick in range(options.ticks):
            sensed = Sensed(
                gyro=0.3 * rng.normal(size=3),
                acceleration=np.array([0.0, 0.0, 9.81]),
                quaternion=np.array([1.0, 0.0, 0.0, 0.0]),
                joint_position=robot.default_pose + 0.02 * rng.normal(size=n),
                joint_velocity=0.3 * rng.normal(size=n),
                joint_torque=np.zeros(n),
            )
            time_s, walk = 1.0 + tick / policy.rate_hz, np.array([0.2, 0.0, 0.1])
            inputs = PolicyInput(time_s, sensed, walk, 0.15 * rng.normal(size=3), height)
            if tick == 0:
                policy.reset(inputs)
            began = time.perf_counter()
            policy.act(inputs)
            act_ms.append(1e3 * (time.perf_counter() - began))
        control = policy.control
        p50, p99 = np.percentile(act_ms[UNTIMED:], [50, 99])
        print(
            f"a tick of {policy.name} on {name}: p50 {p50:.3f} ms, p99 {p99:.3f} ms"
            f" ({control.fallbacks} by the second solver, {control.unsolved_ticks} without a solution)"
        )


if __name__ == "__main__":
    main()
