"""Robots, policies and grounds of the fault table, and the parts that its kinds of runs share.

Not a benchmark itself: `fault_table.py` and its parts use it.
"""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from fault_kinds.battery import CELLS

from footfall.domain_rand.height_scan import HeightScanErrors
from footfall.domain_rand.noise import Noise
from footfall.evaluate.scenarios import at_level, load_scenarios
from footfall.plant.height_scan import SimulatedScanner
from footfall.plant.robot import SimulatedRobot
from footfall.policies.height_scan import common_height_scan
from footfall.policies.policy import Policy
from footfall.policies.registry import load_policy
from footfall.robots.battery import Battery
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import plant_model
from footfall.terrain.declaration import make_ground
from footfall.terrain.ground import Ground


class Subject(NamedTuple):
    """A robot that walks by a policy, on level ground or on that of a scenario."""

    robot: str
    policy: str
    ground: str = ""  # name of a scenario; empty for level ground


SCENARIOS = Path(__file__).with_name("rough_ground.yaml")  # besides those of `footfall evaluate`
SUBJECTS = {  # whether a subject has all rows, or only the main ones
    Subject("go1", "go1-flat"): True,
    Subject("go1", "mpc"): True,
    Subject("hexapod", "hexapod-flat"): False,
    Subject("hexapod", "tripod"): False,
    Subject("g1", "g1-flat"): False,
    Subject("g1", "step"): False,
    Subject("go1", "go1-rough-blind", "rough"): False,
    Subject("go1", "go1-rough", "rough"): False,
    Subject("hexapod", "hexapod-rough", "rough"): False,
    Subject("g1", "g1-rough", "g1_rough"): False,
}
GET_UP = {"go1": "go1-getup"}  # of the robots that can get up
POWERED = ("go1", "g1")  # robots that get a battery; the hexapod's buses are too full for ODrives
PUSHED_OVER_M_S = 9.0  # makes a robot fall, which then gets up
NOISE = Noise(joint_position=0.002, joint_velocity=0.1, gyro=0.02, gravity=0.005)


class FaultTask(NamedTuple):
    """A run with a fault."""

    robot: str
    policy: str
    title: str
    seed: int
    ground: str = ""

    @property
    def subject(self) -> Subject:
        return Subject(self.robot, self.policy, self.ground)


class HealthyTask(NamedTuple):
    """A run of a healthy robot."""

    robot: str
    policy: str
    kind: str  # of `healthy_runs.KINDS`
    seed: int
    ground: str = ""

    @property
    def subject(self) -> Subject:
        return Subject(self.robot, self.policy, self.ground)


@lru_cache(maxsize=4)
def robot_of(name: str) -> Robot:
    return load_robot(name)


@lru_cache(maxsize=4)
def powered(name: str) -> Robot:
    """The robot with a battery that lasts for seconds; ODrives on some joints report its voltage."""
    robot = robot_of(name)
    mass_kg = float(plant_model(robot).body_mass.sum())
    battery = Battery(CELLS, 0.05 * mass_kg, 0.6 / mass_kg, idle_w=5.0 * mass_kg)
    motors = dict(robot.description.motors)
    first = next(iter(motors))
    motors[first] = replace(motors[first], protocol="ODrive")
    return replace(robot, description=replace(robot.description, motors=motors, battery=battery))


def policy_of(robot: str, name: str) -> Policy:
    """A policy for one run. Loaded each time, so that no run inherits what a policy learned in another."""
    return load_policy(name, robot_of(robot))


def ground_of(subject: Subject, seed: int) -> Ground | None:
    """The ground of a run: the seed picks the scenario's level. None is level ground."""
    if not subject.ground:
        return None
    scenario = load_scenarios(robot_of(subject.robot), SCENARIOS).scenarios[subject.ground]
    assert scenario.ground is not None
    level = {name: values[seed % len(values)] for name, values in scenario.levels.items()}
    return make_ground(at_level(scenario.ground, level), seed)


def scanner_of(
    policy: Policy, body: SimulatedRobot, ground: Ground | None, seed: int
) -> SimulatedScanner | None:
    """The simulated robot's height scans, without errors, if its policy reads them."""
    scan = common_height_scan([policy.contract])
    if scan is None:
        return None

    def pose() -> tuple[np.ndarray, np.ndarray]:
        truth = body.truth()
        return truth.base_position, truth.base_quaternion

    return SimulatedScanner(scan, HeightScanErrors(), ground, pose, seed)


def drawn_command(rng: np.random.Generator) -> np.ndarray:
    """A velocity command that every subject can follow: m/s, m/s, rad/s."""
    return np.array([rng.uniform(0.2, 0.6), rng.uniform(-0.2, 0.2), rng.uniform(-0.5, 0.5)])


def is_first(subject: Subject) -> bool:
    """Whether it is the robot's first subject.

    Rows that do not depend on the walking policy have only this one.
    """
    return next(each for each in SUBJECTS if each.robot == subject.robot) == subject
