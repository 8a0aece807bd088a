"""Attitude from gyro and accelerometer alone, on simulated robots that stand, walk and are pushed.

    python benchmarks/attitude.py

Each robot has an IMU without orientation whose gyro has a bias, and the scenarios' sensor noise. Its policy
runs on the attitude of the filter. Prints a table: the angle between the estimated and the true vertical, the
drift of the heading, and the same angle by the base estimator, which knows the base's motion from the legs.
"""

import argparse
import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from footfall.common.rotations import heading, rotation_matrix, wrap_angle
from footfall.deploy.estimation.config import EstimatorConfig
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import MOVING
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, Push, run_episode
from footfall.plant.robot import SimulatedRobot
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

GYRO_BIAS = (0.02, -0.015, 0.01)  # rad/s
STOP_S = 3.0  # time with a zero command, at the end of each walk
FIRST_PUSH_S, PUSH_EVERY_S, PUSH_M_S = 3.0, 2.0, 0.6


class Walk(NamedTuple):
    """One episode."""

    robot: str
    policy: str
    forward_m_s: float
    yaw_rad_s: float
    pushes: int  # number of pushes, each in another direction
    duration_s: float

    def command(self, time_s: float) -> np.ndarray:
        """Velocity command, (3,)."""
        stopped = time_s >= self.duration_s - STOP_S
        return np.zeros(3) if stopped else np.array([self.forward_m_s, 0.0, self.yaw_rad_s])


WALKS = (
    Walk("go1", "go1-flat", 0.8, 0.3, 5, 14.0),
    Walk("go1", "stand", 0.0, 0.0, 2, 8.0),
    Walk("go1", "trot", 0.4, 0.5, 3, 10.0),
    Walk("go1", "mpc", 0.4, 0.5, 0, 6.0),
    Walk("g1", "g1-flat", 0.6, 0.3, 0, 14.0),
    Walk("g1", "balance", 0.0, 0.0, 0, 6.0),
    Walk("hexapod", "hexapod-flat", 0.3, 0.3, 0, 10.0),
)


def push(number: int) -> Push:
    """Push `number` of a walk; each push has another direction."""
    angle = 1.3 * number
    return Push(
        FIRST_PUSH_S + PUSH_EVERY_S * number, (PUSH_M_S * np.cos(angle), PUSH_M_S * np.sin(angle), 0.0)
    )


class Errors(NamedTuple):
    """Errors of one walk at each tick of the joint loop while the policy acts. Arrays are (T,)."""

    fell: bool
    tilt: np.ndarray  # rad
    yaw: np.ndarray  # rad, unwrapped
    tilt_by_legs: np.ndarray  # rad, of the base estimator


def vertical_angle(found: np.ndarray, true: np.ndarray) -> float:
    """Angle between the verticals of two orientations, rad."""
    difference = rotation_matrix(found)[2] - rotation_matrix(true)[2]
    return 2.0 * math.asin(min(1.0, 0.5 * float(np.linalg.norm(difference))))


def errors(walk: Walk, seed: int) -> Errors:
    """Errors of the attitude filter and of the base estimator in one walk."""
    shipped = load_robot(walk.robot)
    robot = replace(shipped, description=replace(shipped.description, imu_protocol="footfall-inertial"))
    policy = load_policy(walk.policy, robot)
    estimator = BaseEstimator(robot, EstimatorConfig(own_attitude=True))
    tilts: list[float] = []
    yaws: list[float] = []
    by_legs: list[float] = []
    tick_times_us: list[int] = []

    def compare(loop: ControlLoop, body: SimulatedRobot) -> None:
        if loop.state.mode not in MOVING:
            return
        if tick_times_us:
            plan = policy.stance() if loop.walking and tilts else None  # None before the policy's first step
            estimator.update(loop.sensed, plan, 1e-6 * (loop.now_us - tick_times_us[-1]))
        else:
            estimator.reset(loop.sensed)
        tick_times_us.append(loop.now_us)
        if loop.walking:
            found, true = loop.sensed.quaternion, body.truth().base_quaternion
            tilts.append(vertical_angle(found, true))
            yaws.append(wrap_angle(float(heading(found) - heading(true))))
            by_legs.append(vertical_angle(estimator.odometry().orientation, true))

    episode = Episode(
        command_source=walk.command,
        duration_s=walk.duration_s,
        seed=seed,
        sample={"gyro_bias": np.array(GYRO_BIAS)},
        noise=load_scenarios(robot).noise,
        pushes=tuple(push(number) for number in range(walk.pushes)),
        record=False,
    )
    trace = run_episode(robot, policy, episode, compare)
    return Errors(trace.fell, np.array(tilts), np.unwrap(yaws), np.array(by_legs))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    print(
        "| robot | policy | m/s | pushes | fell | tilt RMS, degrees | largest | yaw drift | with legs: RMS |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for walk in WALKS:
        found = errors(walk, options.seed)
        rms, legs = (math.degrees(np.sqrt(np.mean(tilt**2))) for tilt in (found.tilt, found.tilt_by_legs))
        largest, drift = np.degrees([found.tilt.max(), found.yaw[-1] - found.yaw[0]])
        print(
            f"| {walk.robot} | {walk.policy} | {walk.forward_m_s:g} | {walk.pushes} |"
            f" {'yes' if found.fell else 'no'} | {rms:.2f} | {largest:.2f} | {drift:.1f} | {legs:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
