"""Gaits in which no foot touches the ground for a part of each cycle."""

from dataclasses import replace

import numpy as np
import pytest

from footfall.domain_rand.randomisation import randomisation_of
from footfall.domain_rand.sample import draw
from footfall.evaluate.scenarios import load_scenarios
from footfall.plant.episode import Episode, run_episode
from footfall.plant.trace import Trace
from footfall.policies.controllers.mpc import Mpc
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.policy import Policy
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot
from footfall.robots.mjcf import load_spec

ROBOT = load_robot("go1")


def run(policy: Policy, command: tuple[float, float, float]) -> Trace:
    """A run of the policy on a randomised robot."""
    rng = np.random.default_rng(2)
    sample = draw(randomisation_of(ROBOT), rng.random, 12, load_spec(ROBOT.xml_path).compile().nbody - 1)
    episode = Episode(
        command_source=lambda _: np.array(command),
        duration_s=1.7,
        sample=sample,
        noise=load_scenarios(ROBOT).noise,
        record_rate_hz=250.0,
    )
    return run_episode(ROBOT, policy, episode)


def test_no_foot_touches_for_a_part_of_each_cycle() -> None:
    trace = run(load_policy("pronk", ROBOT), (0.6, 0.0, 0.4))
    assert not trace.fell
    assert trace.faults == ()
    walking = trace.time_s > 1.0
    assert (~trace.foot_contact[walking].any(axis=1)).mean() > 0.35
    assert trace.base_velocity[walking, 0].mean() == pytest.approx(0.6, abs=0.12)
    assert (np.abs(trace.motor_torque) <= ROBOT.motor.peak_torque * 1.001).all()


def test_a_sideways_pronk_stays_upright_by_compensating_the_legs_momentum() -> None:
    """All legs swing to the same side while no foot is on the ground, so the base rolls to the other side."""
    config = controller_settings(ROBOT, "pronk", MpcConfig)

    def largest_roll(compensated: bool) -> float:
        trace = run(Mpc(ROBOT, replace(config, legs_turn_base=compensated)), (0.0, 0.3, 0.0))
        w, x, y, z = trace.base_quaternion.T
        return float(np.abs(np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))).max())

    assert largest_roll(True) < 0.8 * largest_roll(False)
