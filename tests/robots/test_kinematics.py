"""Leg kinematics of shipped robots against MuJoCo; test_limb.py tests limbs of any kind."""

import mujoco
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from footfall.robots.description import load_robot
from footfall.robots.kinematics import Legs
from footfall.robots.model import joint_addresses, plant_model

ROBOT = load_robot("go1")
LEGS = Legs(ROBOT.description, ROBOT.xml_path)

fractions = arrays(float, len(ROBOT.joint_names), elements=st.floats(0.0, 1.0))


@settings(max_examples=50)
@given(fractions)
def test_feet_and_jacobians_are_mujocos(fraction: np.ndarray) -> None:
    model = plant_model(ROBOT)
    data = mujoco.MjData(model)
    q, v = joint_addresses(model, ROBOT)
    base = model.body(ROBOT.description.base).id
    data.qpos[:7] = [0.3, -0.2, 0.5, 0.5, -0.5, 0.5, 0.5]
    data.qpos[q] = ROBOT.lower_rad + fraction * (ROBOT.upper_rad - ROBOT.lower_rad)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    rotation = data.xmat[base].reshape(3, 3)
    pose = LEGS.pose(data.qpos[q])
    for leg, foot in enumerate(ROBOT.description.feet):
        geom = model.geom(foot.geoms[0]).id
        position = (data.geom_xpos[geom] - data.xpos[base]) @ rotation
        np.testing.assert_allclose(pose.foot[leg], position, atol=1e-9)
        jacobian, turning = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacGeom(model, data, jacobian, turning, geom)
        dofs = v[LEGS.joints[leg]]
        np.testing.assert_allclose(pose.jacobian[leg], rotation.T @ jacobian[:, dofs], atol=1e-9)
        np.testing.assert_allclose(pose.axes[leg], rotation.T @ turning[:, dofs], atol=1e-9)


def test_a_tip_out_of_reach_stretches_the_leg_towards_it() -> None:
    far = LEGS.default_foot * np.array([1.0, 1.0, 3.0])
    reached = LEGS.pose(LEGS.scatter(LEGS.solve(far), ROBOT.default_pose)).foot
    assert np.all(reached[:, 2] < LEGS.default_foot[:, 2] - 0.05)
    np.testing.assert_allclose(reached[:, :2], far[:, :2], atol=0.08)


class TestLoad:
    """Torques that carry the limbs' weight, against the potential energy."""

    def test_rotations_and_torques_are_of_the_given_pose_despite_caches(self) -> None:
        """The results hold after other computations, such as inverse kinematics through MuJoCo."""
        robot = load_robot("g1")
        legs, down = robot.legs, np.array([0.0, 0.0, 9.81])
        pose = robot.default_pose + 0.1
        turn, torque = legs.tip_rotation(pose).copy(), legs.holding_torque(pose, down)
        legs.pose(robot.default_pose)
        assert not np.allclose(legs.tip_rotation(robot.default_pose), turn)
        np.testing.assert_array_equal(legs.tip_rotation(pose), turn)
        legs.solve(legs.default_foot + 0.02)
        np.testing.assert_array_equal(legs.tip_rotation(pose), turn)
        np.testing.assert_array_equal(legs.holding_torque(pose, down), torque)


def test_a_cached_rolling_offset_belongs_to_its_arguments() -> None:
    level, tilted = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.8])
    axes = LEGS.pose(ROBOT.default_pose).axes
    once = LEGS.rolling_offset(axes, level).copy()
    assert not np.allclose(LEGS.rolling_offset(axes, tilted), once)
    np.testing.assert_array_equal(LEGS.rolling_offset(axes, level), once)
    np.testing.assert_array_equal(LEGS.rolling_offset(-axes, level), -once)
