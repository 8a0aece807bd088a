"""Controllers and estimator on made-up robots: other numbers of legs, hinges and soles."""

from dataclasses import replace

import numpy as np
import pytest
from made_up import BIPED, FIVE, SOLES
from moments import readings

from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.policies.controllers.gait import GaitConfig
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.walk import Walk
from footfall.policies.controllers.walk.config import StanceConfig, WalkConfig
from footfall.policies.policy import Policy, PolicyInput, Sensed
from footfall.robots.description import Robot, load_robot

GO1 = load_robot("go1")


def at_rest(robot: Robot) -> Sensed:
    """Inputs of a robot in its default pose whose legs carry 40 N each."""
    legs = robot.legs
    force = np.tile([0.0, 0.0, 40.0], (legs.count, 1))
    load = legs.scatter(legs.torque(legs.pose(robot.default_pose).jacobian, force), np.zeros_like(robot.kp))
    return readings(robot, torque=load)


def seen(robot: Robot, time_s: float, command: float = 0.0) -> PolicyInput:
    height = float(-robot.legs.default_foot[:, 2].mean())
    return PolicyInput(time_s, at_rest(robot), np.array([command, 0.0, 0.0]), np.zeros(3), height)


def tips(robot: Robot, policy: Policy, inputs: PolicyInput) -> np.ndarray:
    """Commanded positions of the feet; all commanded values are finite."""
    command = policy.act(inputs)
    assert all(values.shape == robot.default_pose.shape for values in command)
    assert np.all(np.isfinite(np.array(command)))
    return robot.legs.pose(command.position).foot


@pytest.mark.parametrize("kind", [FIVE, BIPED, SOLES])
class TestAnyRobot:
    def test_the_estimator_finds_a_standing_robot_at_rest(self, bodies: dict[str, Robot], kind: str) -> None:
        robot = bodies[kind]
        estimator = BaseEstimator(robot)
        estimator.reset(at_rest(robot))
        for _ in range(50):
            velocity, height = estimator.update(at_rest(robot), None, 0.002)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-6)
        assert height == pytest.approx(-robot.legs.default_foot[:, 2].mean(), abs=1e-3)


@pytest.mark.parametrize("kind", [BIPED, SOLES])
class TestTwoLegs:
    def test_a_walk_carries_standing_feet_back_and_lifts_others(
        self, bodies: dict[str, Robot], kind: str
    ) -> None:
        """The lowest point of a sphere moves with the ground, its centre slower because it rolls."""
        robot = bodies[kind]
        config = controller_settings(GO1, "trot", WalkConfig)
        height = -float(robot.legs.default_foot[:, 2].mean()) + 0.01
        config = replace(
            config,
            rate_hz=100.0,
            gait=GaitConfig("walk", 0.6, 0.6),
            step=replace(config.step, body_height_m=height),
            stance=StanceConfig(),
        )
        policy = Walk(robot, "walk", config)
        policy.reset(seen(robot, 0.0))
        feet = np.array([tips(robot, policy, seen(robot, 1.0 + k / 100, 0.2)) for k in range(180)])
        ground = feet[:, :, 2].min() + 1e-6
        down = (feet[1:, :, 2] < ground) & (feet[:-1, :, 2] < ground)
        speed = 100.0 * np.diff(feet[:, :, 0], axis=0)[100:][down[100:]]
        low, high = (-0.205, -0.195) if kind == SOLES else (-0.2, -0.17)
        assert low < speed.min() < speed.max() < high
        np.testing.assert_allclose(np.ptp(feet[100:, :, 2], axis=0), config.step.height_m, rtol=0.1)
