"""The ground's slope from standing feet, and how controllers use it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from moments import policy_input
from scipy.spatial.transform import Rotation

from footfall.policies.controllers.mpc import Mpc
from footfall.policies.controllers.mpc.config import MpcConfig
from footfall.policies.controllers.mpc.grip import Grip
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.slope import (
    Slope,
    SlopeConfig,
    applied_gradient,
    corrected_gradient,
    plane_quaternion,
)
from footfall.policies.controllers.walk import Walk
from footfall.policies.policy import PolicyInput
from footfall.robots.description import load_robot

ROBOT = load_robot("go1")
LEGS = ROBOT.legs
CONFIG = SlopeConfig(filter_s=0.1, deadband=0.0, max_gradient=0.6)
LEVEL = np.zeros(2)
ALL = np.ones(4)
DT_S = 0.002
STEEP = math.tan(0.3)
# Headings of 0 and in between, on a slope that rises along the world's x axis by 0.3 rad.
HEADINGS = [0.0, -2.0]


def parallel(heading: float) -> Rotation:
    """A base that is parallel to the slope."""
    return Rotation.from_euler("y", -0.3) * Rotation.from_euler("z", heading)


def standing(heading: float, time_s: float = 9.0, forward_m_s: float = 0.0) -> PolicyInput:
    """Inputs of a robot on the slope, parallel to it, in the default pose."""
    tips = parallel(heading).apply(LEGS.default_foot)
    height = -float(tips[:, 2].mean())
    command = (forward_m_s, 0.0, 0.0)
    return policy_input(ROBOT, time_s, command, base_height=height, turn=parallel(heading))


def on_plane(gradient: np.ndarray, seed: int) -> np.ndarray:
    positions = LEGS.default_foot + np.random.default_rng(seed).uniform(-0.05, 0.05, (4, 3))
    positions[:, 2] = 0.7 + positions[:, :2] @ gradient
    return positions


def settled(policy: Mpc | Walk, heading: float, forward_m_s: float = 0.0) -> PolicyInput:
    """Let a policy stand on the slope for 1.2 s; returns its last inputs."""
    inputs = standing(heading, 0.0, forward_m_s)
    policy.reset(inputs)
    for tick in range(600):
        inputs = standing(heading, 1.0 + tick * DT_S, forward_m_s)
        policy.act(inputs)
    return inputs


class TestGradient:
    def test_alternating_pairs_of_feet_give_both_slopes(self) -> None:
        planted, found = np.array([0.3, -0.2]), LEVEL
        for tick in range(4000):
            pair = np.array([1.0, 0.0, 0.0, 1.0]) if tick // 100 % 2 else np.array([0.0, 1.0, 1.0, 0.0])
            found = corrected_gradient(found, on_plane(planted, 1), pair, 0.02)
        np.testing.assert_allclose(found, planted, atol=0.01)

    def test_nearly_level_ground_is_level_and_steep_ground_is_bounded(self) -> None:
        assert not applied_gradient(np.array([0.03, 0.03]), 0.05, 0.5).any()
        np.testing.assert_allclose(applied_gradient(np.array([0.0, -0.25]), 0.05, 0.5), [0.0, -0.2])
        assert np.hypot(*applied_gradient(np.array([3.0, 4.0]), 0.05, 0.5)) == pytest.approx(0.5)


class TestSeenFromTheGround:
    @pytest.mark.parametrize("gradient", [(0.3, 0.0), (0.0, 0.3), (-0.2, 0.4)])
    def test_the_axes_lie_on_the_ground(self, gradient: tuple[float, float]) -> None:
        turn = Rotation.from_quat(plane_quaternion(np.array(gradient)), scalar_first=True)
        normal = np.array([-gradient[0], -gradient[1], 1.0])
        np.testing.assert_allclose(turn.apply([0.0, 0.0, 1.0]), normal / np.linalg.norm(normal))
        assert turn.as_rotvec()[2] == pytest.approx(0.0)  # smallest rotation: none about the vertical

    @pytest.mark.parametrize("heading", HEADINGS)
    def test_a_robot_parallel_to_the_ground_is_level_at_its_own_height(self, heading: float) -> None:
        slope = Slope(CONFIG)
        for _ in range(1000):
            inputs = slope.follow(standing(heading), LEGS.default_foot, ALL, DT_S)
        up = Rotation.from_quat(inputs.sensed.quaternion, scalar_first=True).inv().apply([0.0, 0.0, 1.0])
        np.testing.assert_allclose(up, [0.0, 0.0, 1.0], atol=2e-3)
        assert inputs.base_height == pytest.approx(-LEGS.default_foot[:, 2].mean(), abs=1e-3)

    def test_an_episode_begins_on_level_ground(self) -> None:
        slope = Slope(CONFIG)
        for _ in range(100):
            slope.follow(standing(0.0), LEGS.default_foot, ALL, DT_S)
        slope.reset()
        np.testing.assert_allclose(slope.axes, np.eye(3))
        np.testing.assert_allclose(slope.gravity, [0.0, 0.0, -9.81])

    def test_without_settings_the_inputs_stay(self) -> None:
        inputs = standing(0.0)
        assert Slope(None).follow(inputs, LEGS.default_foot, ALL, DT_S) is inputs


class TestMpc:
    CONFIG = replace(controller_settings(ROBOT, "mpc", MpcConfig), slope=CONFIG)

    def test_footholds_are_reported_in_the_level_heading_frame(self) -> None:
        """Up the slope the foothold ahead is higher than that behind by the gradient."""
        policy = Mpc(ROBOT, self.CONFIG)
        settled(policy, 0.0, forward_m_s=0.3)
        positions = policy.footholds()
        x, _, z = positions[~np.isnan(positions[:, 0])].T
        assert len(x) == 2
        assert (z[0] - z[1]) / (x[0] - x[1]) == pytest.approx(STEEP, abs=0.02)

    def test_slipping_feet_still_hold_the_robot_on_the_slope(self) -> None:
        contact = replace(self.CONFIG.contact, slip_m_s=1e-6)
        grip = Grip(LEGS, contact)
        level = grip.friction(0.0)
        sensed = policy_input(ROBOT, velocity=np.arange(12.0)).sensed
        grip.follow(sensed, LEGS.pose(ROBOT.default_pose), np.array([0.0, 0.0, 1.0]), ALL, DT_S)
        assert grip.friction(0.0) == contact.slipping_friction < level
        assert grip.friction(STEEP) >= STEEP + contact.slipping_friction
