"""Leg kinematics against MuJoCo's, and inverse kinematics of limbs of any kind."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from edited import edit
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from made_up import BIPED, FIVE, PITCH, SOLES, Hinge, Leg, quadruped_leg, write_robot
from refused import refusal_of

from footfall import Robot, load_robot
from footfall.robots.kinematics import Legs
from footfall.robots.model import joint_addresses, plant_model

ROBOT = load_robot("go1")
LEGS = Legs(ROBOT.description, ROBOT.xml_path)


@settings(max_examples=50)
@given(arrays(float, len(ROBOT.joint_names), elements=st.floats(0.0, 1.0)))
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


def test_rotations_and_torques_are_of_the_given_pose_despite_caches() -> None:
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


@pytest.mark.parametrize("kind", [FIVE, BIPED, SOLES, "go1"])
@settings(max_examples=25)
@given(data=st.data())
def test_inverse_kinematics_inverts_forward_kinematics_within_the_limits(
    bodies: dict[str, Robot], kind: str, data: st.DataObject
) -> None:
    """Redundant hinges may give another pose for the same position. No position is in reach for sure."""
    robot = bodies.get(kind, ROBOT)
    legs, pose = robot.legs, robot.default_pose
    fraction = data.draw(arrays(float, len(pose), elements=st.floats(-1.0, 1.0)))
    room = np.where(fraction < 0, pose - robot.lower_rad, robot.upper_rad - pose)
    reachable = legs.pose(pose + (0.25 if kind == "go1" else 0.5) * fraction * room).foot
    anywhere = data.draw(arrays(float, (legs.count, 3), elements=st.floats(-2.0, 2.0)))
    found, far = (legs.scatter(legs.solve(feet), pose) for feet in (reachable, anywhere))
    np.testing.assert_allclose(legs.pose(found).foot, reachable, atol=1e-6)
    for angles in (found, far):
        assert np.all((angles >= robot.lower_rad - 1e-9) & (angles <= robot.upper_rad + 1e-9))


def test_a_limb_with_a_closed_form_is_solved_by_it(bodies: dict[str, Robot]) -> None:
    assert bodies[FIVE].legs.inverse.closed == [True, True, True, True, False]
    assert all(bodies[BIPED].legs.inverse.closed)


def test_a_sole_is_located_by_its_middle_and_stays_level_at_any_position(bodies: dict[str, Robot]) -> None:
    """Each leg has six hinges."""
    robot = bodies[SOLES]
    legs = robot.legs
    model = mujoco.MjModel.from_xml_path(str(robot.xml_path))
    data = mujoco.MjData(model)
    data.qpos[:] = (0, 0, 0, 1, 0, 0, 0, *robot.default_pose)
    mujoco.mj_kinematics(model, data)
    corners = np.array([data.geom(name).xpos for name in robot.description.feet[0].geoms])
    np.testing.assert_allclose(legs.default_foot[0], corners.mean(axis=0), atol=1e-12)
    np.testing.assert_allclose(legs.default_foot[1], data.geom("r_foot0").xpos, atol=1e-12)
    np.testing.assert_allclose(legs.foot_radius, [0.012, 0.010], atol=1e-9)
    feet = legs.default_foot + np.array([[0.08, 0.02, 0.05], [-0.06, -0.03, 0.02]])
    turn = legs.tip_rotation(legs.scatter(legs.solve(feet), robot.default_pose))
    np.testing.assert_allclose(turn, np.tile(np.eye(3), (2, 1, 1)), atol=1e-6)


def test_the_geoms_of_a_foot_belong_to_one_body(tmp_path: Path) -> None:
    write_robot(tmp_path, [quadruped_leg("a", 0.2, 0.1), quadruped_leg("b", -0.2, -0.1)])
    edit(tmp_path, "robot.yaml", "- a_foot0", "- a_foot0\n  - shin")
    edit(tmp_path, "robot.xml", '<geom type="capsule"', '<geom name="shin" type="capsule"')
    assert "foot a" in refusal_of(load_robot, tmp_path)


def test_a_leg_of_two_hinges_beside_one_of_three_moves_as_far_as_it_can(tmp_path: Path) -> None:
    """A leg of two hinges moves only in its plane."""
    two = Leg("b", (-0.2, -0.1, 0.0), [Hinge(PITCH, (0.0, 0.0, -0.2), angle) for angle in (0.5, -0.9)])
    legs = write_robot(tmp_path, [quadruped_leg("a", 0.2, 0.1), two]).legs
    jacobian = legs.pose(legs.scatter(legs.default_angles, np.zeros(5))).jacobian
    moved = jacobian @ legs.joint_rates(jacobian, np.tile([[0.1], [0.2], [0.3]], (2, 1, 1)))
    np.testing.assert_allclose(moved[..., 0], [[0.1, 0.2, 0.3], [0.1, 0.0, 0.3]], atol=1e-3)
