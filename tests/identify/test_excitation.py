"""The excitation of robots on a stand."""

import mujoco
import numpy as np
import pytest
from moments import readings
from scipy.spatial.transform import Rotation

from footfall.identify.clearance import clear_share
from footfall.identify.excitation import Excitation, ExcitationConfig
from footfall.policies.policy import PolicyInput
from footfall.robots.description import Robot, load_robot
from footfall.robots.model import joint_addresses, plant_model

RATE_HZ = 25.0


def targets(robot: Robot, config: ExcitationConfig) -> np.ndarray:
    """All position targets of the excitation, (T, n)."""
    motion = Excitation(robot, config, RATE_HZ)
    sensed = readings(robot, Rotation.identity())
    times = np.arange(0.0, motion.duration_s, 1.0 / RATE_HZ).tolist()
    inputs = [PolicyInput(at, sensed, np.zeros(3), np.zeros(3), 0.3) for at in times]
    motion.reset(inputs[0])
    return np.array([motion.act(each).position for each in inputs])


def overlap_m(robot: Robot, poses: np.ndarray) -> float:
    """Largest overlap of two bodies of the robot over all poses, m."""
    model = plant_model(robot)
    data = mujoco.MjData(model)
    qpos_addresses, _ = joint_addresses(model, robot)
    data.qpos[2] = 1.0
    worst = 0.0
    for pose in poses:
        data.qpos[qpos_addresses] = pose
        mujoco.mj_forward(model, data)
        worst = max(worst, -float(data.contact.dist.min(initial=0.0)))
    return worst


@pytest.mark.parametrize("name", ["go1", "g1", "hexapod"])
def test_all_targets_are_within_the_soft_limits_and_keep_bodies_apart(name: str) -> None:
    robot = load_robot(name)
    low, high = robot.soft_limits
    found = targets(robot, ExcitationConfig())
    assert ((low < found) & (found < high)).all()
    assert overlap_m(robot, found) < 2e-3


def test_a_swing_that_would_press_legs_into_the_trunk_is_reduced(go1: Robot) -> None:
    """Left thighs reach the trunk where hips turn inwards and thighs forwards."""
    towards = np.tile([-0.6, 0.6, -0.6], 4)
    share = clear_share(go1, lambda share: go1.default_pose + share * towards[None])
    assert 0.0 < share < 1.0
    assert overlap_m(go1, go1.default_pose + share * towards[None]) == 0.0
    assert overlap_m(go1, go1.default_pose + towards[None]) > 1e-3


def test_the_two_chirps_move_about_poses_in_which_gravity_acts_differently(go1: Robot) -> None:
    config = ExcitationConfig()
    away = targets(go1, config) - go1.default_pose
    ticks = int(config.chirp_s * RATE_HZ)
    end = len(away) - int(config.burst_s * RATE_HZ)
    first, second = away[end - 2 * ticks : end - ticks].mean(axis=0), away[end - ticks : end].mean(axis=0)
    hips = [joints[0] for joints in go1.foot_joints]
    assert (np.abs(first - second)[hips] > 0.3).all()
