"""Level stances: standing levelled by the IMU, and the ground's slope from standing feet."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from moments import UP, policy_input
from scipy.spatial.transform import Rotation

from footfall import PolicyInput, load_robot
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
from footfall.policies.controllers.stance import level_feet, nominal_feet, tilt_correction
from footfall.policies.controllers.stand import Stand, StandConfig

ROBOT = load_robot("go1")
LEGS = ROBOT.legs
CONFIG = SlopeConfig(filter_s=0.1, deadband=0.0, max_gradient=0.6)
MPC_CONFIG = replace(controller_settings(ROBOT, "mpc", MpcConfig), slope=CONFIG)
ALL, DT_S, STEEP = np.ones(4), 0.002, math.tan(0.3)


def standing(heading: float, time_s: float = 9.0, forward_m_s: float = 0.0) -> PolicyInput:
    """Inputs of a robot in the default pose, parallel to a slope.

    The slope rises along the world's x axis by 0.3 rad.
    """
    turn = Rotation.from_euler("y", -0.3) * Rotation.from_euler("z", heading)
    height = -float(turn.apply(LEGS.default_foot)[:, 2].mean())
    return policy_input(ROBOT, time_s, (forward_m_s, 0.0, 0.0), base_height=height, turn=turn)


def test_alternating_pairs_of_feet_give_both_slopes() -> None:
    planted, found = np.array([0.3, -0.2]), np.zeros(2)
    feet = LEGS.default_foot + np.random.default_rng(1).uniform(-0.05, 0.05, (4, 3))
    feet[:, 2] = 0.7 + feet[:, :2] @ planted
    for tick in range(4000):
        pair = np.array([1.0, 0.0, 0.0, 1.0]) if tick // 100 % 2 else np.array([0.0, 1.0, 1.0, 0.0])
        found = corrected_gradient(found, feet, pair, 0.02)
    np.testing.assert_allclose(found, planted, atol=0.01)


def test_nearly_level_ground_is_level_and_steep_ground_is_bounded() -> None:
    for gradient, applied in (((0.03, 0.03), (0, 0)), ((0.0, -0.25), (0.0, -0.2)), ((3.0, 4.0), (0.3, 0.4))):
        np.testing.assert_allclose(applied_gradient(np.array(gradient), 0.05, 0.5), applied)


@pytest.mark.parametrize("gradient", [(0.3, 0.0), (0.0, 0.3), (-0.2, 0.4)])
def test_the_axes_lie_on_the_ground(gradient: tuple[float, float]) -> None:
    turn = Rotation.from_quat(plane_quaternion(np.array(gradient)), scalar_first=True)
    normal = np.array([-gradient[0], -gradient[1], 1.0])
    np.testing.assert_allclose(turn.apply(UP), normal / np.linalg.norm(normal))
    assert turn.as_rotvec()[2] == pytest.approx(0.0)  # smallest rotation: none about the vertical


@pytest.mark.parametrize("heading", [0.0, -2.0])
def test_a_robot_parallel_to_the_ground_is_level_at_its_own_height(heading: float) -> None:
    """A new episode begins on level ground."""
    slope = Slope(CONFIG)
    for _ in range(1000):
        inputs = slope.follow(standing(heading), LEGS.default_foot, ALL, DT_S)
    up = Rotation.from_quat(inputs.sensed.quaternion, scalar_first=True).inv().apply(UP)
    np.testing.assert_allclose(up, UP, atol=2e-3)
    assert inputs.base_height == pytest.approx(-LEGS.default_foot[:, 2].mean(), abs=1e-3)
    slope.reset()
    np.testing.assert_allclose(slope.axes, np.eye(3))
    np.testing.assert_allclose(slope.gravity, [0.0, 0.0, -9.81])


def test_without_settings_the_inputs_stay() -> None:
    inputs = standing(0.0)
    assert Slope(None).follow(inputs, LEGS.default_foot, ALL, DT_S) is inputs


def test_footholds_are_reported_in_the_level_heading_frame() -> None:
    """Up the slope the foothold ahead is higher than that behind by the gradient."""
    policy = Mpc(ROBOT, MPC_CONFIG)
    policy.reset(standing(0.0, 0.0, 0.3))
    for tick in range(600):
        policy.act(standing(0.0, 1.0 + tick * DT_S, 0.3))
    positions = policy.footholds()
    x, _, z = positions[~np.isnan(positions[:, 0])].T
    assert len(x) == 2
    assert (z[0] - z[1]) / (x[0] - x[1]) == pytest.approx(STEEP, abs=0.02)


def test_slipping_feet_still_hold_the_robot_on_the_slope() -> None:
    contact = replace(MPC_CONFIG.contact, slip_m_s=1e-6)
    grip = Grip(LEGS, contact)
    level = grip.friction(0.0)
    sensed = policy_input(ROBOT, velocity=np.arange(12.0)).sensed
    grip.follow(sensed, LEGS.pose(ROBOT.default_pose), UP, ALL, DT_S)
    assert grip.friction(0.0) == contact.slipping_friction < level
    assert grip.friction(STEEP) >= STEEP + contact.slipping_friction


def observed(turn: Rotation, time_s: float = 9.0, **more: Any) -> PolicyInput:
    """Inputs of a turned robot whose joints differ from the default pose and each other."""
    position, velocity = ROBOT.default_pose + 0.01 * np.arange(12), 0.1 * np.arange(12)
    return policy_input(ROBOT, time_s, base_height=0.26, turn=turn, joint=position, velocity=velocity, **more)


def test_a_robot_moves_from_its_initial_pose_to_a_level_default_pose() -> None:
    config = StandConfig(100.0, 33.0, 1.5, 0.8, tilt_rate_gain_s=0.05, max_tilt_rad=0.3, settle_s=2.0)
    policy = Stand(ROBOT, config)
    begun = observed(Rotation.identity(), time_s=0.0)
    policy.reset(begun)
    start = begun.sensed.joint_position.copy()
    begun.sensed.joint_position[:] = 99.0
    quarter = policy.act(begun._replace(time_s=0.5)).position
    np.testing.assert_allclose(quarter, 0.75 * start + 0.25 * ROBOT.default_pose, atol=1e-9)
    for time_s in (2.0, 7.0):
        settled = policy.act(observed(Rotation.identity(), time_s=time_s))
        np.testing.assert_allclose(settled.position, ROBOT.default_pose, atol=1e-9)
    assert (settled.kp.tolist(), settled.kd.tolist()) == ([33.0] * 12, [1.5] * 12)
    assert not np.any([settled.velocity, settled.torque])
    again = observed(Rotation.identity(), time_s=0.0)
    policy.reset(again)
    np.testing.assert_allclose(policy.act(again).position, again.sensed.joint_position)
    assert policy.rate_hz == 100.0
    assert policy.stance().tolist() == [1.0] * 4  # type: ignore[union-attr]


def test_feet_stand_outward_forward_and_below_as_configured() -> None:
    """A leg in the middle plane does not move outward; the feet's own positions stay unchanged."""
    foot_positions = np.array([[0.2, -0.1, -0.3], [-0.2, 0.15, -0.25], [0.0, 1e-9, -0.2]])
    legs = SimpleNamespace(default_foot=foot_positions.copy(), foot_radius=np.array([0.02, 0.03, 0.01]))
    feet = nominal_feet(legs, height_m=0.3, outward_m=0.04, shift_m=0.05)  # type: ignore[arg-type]
    expected = [[0.25, -0.14, -0.28], [-0.15, 0.19, -0.27], [0.05, 0.0, -0.29]]
    np.testing.assert_allclose(feet, expected, atol=1e-8)
    np.testing.assert_array_equal(legs.default_foot, foot_positions)


@pytest.mark.parametrize(("roll", "pitch"), [(0.05, 0.0), (0.0, 0.08), (-0.04, 0.06)])
@pytest.mark.parametrize("yaw", [0.0, 2.5])
def test_the_measured_tilt_is_roll_and_pitch_at_any_heading(roll: float, pitch: float, yaw: float) -> None:
    seen = observed(Rotation.from_euler("ZYX", [yaw, pitch, roll]), gyro=(0.3, -0.5, 9.0))
    np.testing.assert_allclose(tilt_correction(seen, 2.0, 0.0, 9.0), [2 * roll, 2 * pitch], atol=3e-3)
    both = tilt_correction(seen, 2.0, 0.1, 9.0) - tilt_correction(seen, 2.0, 0.0, 9.0)
    np.testing.assert_allclose(both, [0.03, -0.05])
    np.testing.assert_allclose(tilt_correction(seen, 0.0, 1.0, 0.2), [0.2, -0.2])


def test_feet_of_a_rotated_plane_move_along_z_as_its_points_do() -> None:
    roll, pitch = 2e-4, -3e-4
    feet = np.random.default_rng(12).uniform(-0.3, 0.3, (4, 3))
    turned = Rotation.from_euler("xyz", [roll, pitch, 0.0]).apply(feet * [1.0, 1.0, 0.0])
    moved = level_feet(feet, np.array([roll, pitch])) - feet
    np.testing.assert_allclose(moved, turned * [0.0, 0.0, 1.0], atol=1e-6)
    assert np.abs(moved).max() > 1e-5
