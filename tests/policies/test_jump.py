"""A jump ahead on command, by the simulated robot's ground truth."""

from dataclasses import replace

import numpy as np
import pytest

from footfall.deploy.config import deploy_config
from footfall.evaluate.scenarios import load_scenarios
from footfall.operate.abilities import abilities_of
from footfall.operate.missions.mission import mission_of
from footfall.operate.missions.source import MissionSource
from footfall.plant.episode import Episode, run_episode
from footfall.plant.trace import Trace
from footfall.policies.controllers.jump.config import JumpConfig
from footfall.policies.controllers.jump.motion import LeapPlan
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.registry import load_policy
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
STANDS_S = 0.6


def jumps(trace: Trace) -> int:
    """How often the robot rises by a tenth of a metre."""
    high = trace.base_position[:, 2] > 0.38
    return int((high[1:] & ~high[:-1]).sum())


def test_on_command_it_jumps_ahead_and_stands_again() -> None:
    """The robot jumps once, although the command lasts until after the landing."""
    episode = Episode(
        command_source=lambda time_s: np.array([0.5 * (time_s < 1.2), 0.0, 0.0]),
        duration_s=3.0,
        noise=load_scenarios(ROBOT).noise,
        record_rate_hz=250.0,
    )
    trace = run_episode(ROBOT, load_policy("jump", ROBOT), episode)
    assert (trace.fell, trace.faults) == (False, ())
    begin = int(np.searchsorted(trace.time_s, STANDS_S))
    base, feet = trace.base_position - trace.base_position[begin], trace.foot_position[:, :, 2]
    assert base[:, 2].max() >= 0.15
    assert feet.min(axis=1).max() - feet[begin].mean() >= 0.15
    assert 0.4 <= np.hypot(*base[-1, :2]) <= 0.7
    assert np.linalg.norm(trace.base_velocity[-1]) < 0.05
    assert base[-1, 2] == pytest.approx(0.0, abs=0.02)
    assert (np.abs(trace.motor_torque) <= ROBOT.motor.peak_torque * 1.001).all()
    assert jumps(trace) == 1


def test_the_plans_velocity_is_the_derivative_of_its_position() -> None:
    config = controller_settings(ROBOT, "jump", JumpConfig)
    plan, stance_m, step_s = LeapPlan(config), config.plan.stance.height_m, 1e-4
    for begin, end in ((0.0, config.leap.crouch_s), (config.leap.crouch_s, plan.take_off_s)):
        aims = [plan.base(time_s, stance_m) for time_s in np.arange(begin, end - step_s, step_s)]
        position, velocity, acceleration = (np.array(each) for each in zip(*aims, strict=True))
        np.testing.assert_allclose(np.diff(position, axis=0) / step_s, velocity[:-1], atol=0.01)
        np.testing.assert_allclose(np.diff(velocity, axis=0) / step_s, acceleration[:-1], rtol=0.02, atol=0.5)
    leaving, later = (plan.base(plan.take_off_s + late_s, stance_m) for late_s in (0.0, 0.1))
    np.testing.assert_array_equal(later.position, leaving.position)
    np.testing.assert_array_equal(later.velocity, leaving.velocity)


def test_a_mission_jumps_twice_and_returns_to_another_policy() -> None:
    policies = {name: load_policy(name, ROBOT) for name in ("stand", "jump")}
    source = MissionSource(
        mission_of({"steps": [{"jump": 2}, {"wait": 0.5}]}, "mission"), "stand", abilities_of(policies, ROBOT)
    )
    config = replace(deploy_config(ROBOT), odometry=True)
    episode = Episode(source, 30.0, config=config, record_rate_hz=100.0, others={"jump": policies["jump"]})
    trace = run_episode(ROBOT, policies["stand"], episode)
    assert source.progress.done
    assert (trace.fell, trace.faults) == (False, ())
    assert jumps(trace) == 2
