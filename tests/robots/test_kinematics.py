"""Leg kinematics of shipped robots against MuJoCo; test_limb.py tests limbs of any kind."""

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from footfall.robots.description import load_robot
from footfall.robots.kinematics import Legs
from footfall.robots.mjcf import load_spec
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

    @pytest.mark.parametrize("name", ["go1", "g1", "hexapod"])
    @pytest.mark.parametrize("acceleration", [(0.0, 0.0, 9.81), (3.0, -2.0, 12.0)])
    def test_holding_torque_is_a_slope(self, name: str, acceleration: tuple[float, float, float]) -> None:
        """The energy is the mass times the centre of mass along the proper acceleration; the base rests."""
        robot, proper_acceleration = load_robot(name), np.array(acceleration)
        legs, model = robot.legs, load_spec(robot.xml_path).compile()
        data = mujoco.MjData(model)
        q, _ = joint_addresses(model, robot)
        base = model.body(robot.description.base).id
        pose = robot.default_pose + 0.1 * np.sin(np.arange(len(robot.joint_names)))

        def energy(joints: np.ndarray) -> float:
            data.qpos[:] = 0.0
            data.qpos[3], data.qpos[q] = 1.0, joints
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            return float(model.body_subtreemass[base] * data.subtree_com[base] @ proper_acceleration)

        step = 1e-5 * np.eye(len(pose))
        slope = np.array([energy(pose + each) - energy(pose - each) for each in step]) / 2e-5
        assert np.abs(slope).max() > 0.1
        np.testing.assert_allclose(
            legs.holding_torque(pose, proper_acceleration), legs.gather(slope), atol=1e-5
        )

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
