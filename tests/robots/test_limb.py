"""Limbs of any kind: inverse against forward kinematics, limits, positions out of reach."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from edited import edit
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from made_up import BIPED, FIVE, PITCH, SOLES, Hinge, Leg, quadruped_leg, write_robot

from footfall.common.errors import UserError
from footfall.robots.description import Robot, load_robot

KINDS = (FIVE, BIPED, SOLES, "go1")


@pytest.fixture(scope="module")
def robots(bodies: dict[str, Robot], go1: Robot) -> dict[str, Robot]:
    return {**bodies, "go1": go1}


def near_default(robot: Robot, fraction: np.ndarray, share: float = 0.5) -> np.ndarray:
    """Poses about the default one, in a share of the way to the joint limits."""
    down, up = robot.default_pose - robot.lower_rad, robot.upper_rad - robot.default_pose
    return robot.default_pose + share * np.where(fraction < 0, fraction * down, fraction * up)


def fractions(robot: Robot) -> st.SearchStrategy[np.ndarray]:
    return arrays(float, len(robot.joint_names), elements=st.floats(-1.0, 1.0))


@pytest.mark.parametrize("kind", KINDS)
class TestAnyLimb:
    @settings(max_examples=25)
    @given(data=st.data())
    def test_inverse_kinematics_inverts_forward_kinematics(
        self, robots: dict[str, Robot], kind: str, data: st.DataObject
    ) -> None:
        """Redundant hinges may give another pose for the same position."""
        robot = robots[kind]
        legs = robot.legs
        joint = near_default(robot, data.draw(fractions(robot)), 0.25 if kind == "go1" else 0.5)
        expected = legs.pose(joint).foot
        angles = legs.scatter(legs.solve(expected), robot.default_pose)
        np.testing.assert_allclose(legs.pose(angles).foot, expected, atol=1e-6)
        assert np.all((angles >= robot.lower_rad - 1e-9) & (angles <= robot.upper_rad + 1e-9))

    @settings(max_examples=25)
    @given(data=st.data())
    def test_any_position_gives_finite_angles_within_the_limits(
        self, robots: dict[str, Robot], kind: str, data: st.DataObject
    ) -> None:
        robot = robots[kind]
        feet = data.draw(arrays(float, (robot.legs.count, 3), elements=st.floats(-2.0, 2.0)))
        angles = robot.legs.scatter(robot.legs.solve(feet), robot.default_pose)
        assert np.all(np.isfinite(angles))
        assert np.all((angles >= robot.lower_rad - 1e-9) & (angles <= robot.upper_rad + 1e-9))


def test_a_limb_with_a_closed_form_is_solved_by_it(robots: dict[str, Robot]) -> None:
    assert robots[FIVE].legs.inverse.closed == [True, True, True, True, False]
    assert all(robots[BIPED].legs.inverse.closed)


class TestSoles:
    def test_the_tip_is_the_middle_of_the_sole(self, robots: dict[str, Robot]) -> None:
        robot = robots[SOLES]
        model = mujoco.MjModel.from_xml_path(str(robot.xml_path))
        data = mujoco.MjData(model)
        data.qpos[3] = 1.0
        data.qpos[:3] = 0.0
        data.qpos[7:] = robot.default_pose
        mujoco.mj_kinematics(model, data)
        corners = np.array([data.geom(name).xpos for name in robot.description.feet[0].geoms])
        np.testing.assert_allclose(robot.legs.default_foot[0], corners.mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(robot.legs.default_foot[1], data.geom("r_foot0").xpos, atol=1e-12)
        np.testing.assert_allclose(robot.legs.foot_radius, [0.012, 0.010], atol=1e-9)

    def test_a_sole_on_six_hinges_stays_level_at_any_position(self, robots: dict[str, Robot]) -> None:
        robot = robots[SOLES]
        legs = robot.legs
        feet = legs.default_foot + np.array([[0.08, 0.02, 0.05], [-0.06, -0.03, 0.02]])
        turn = legs.tip_rotation(legs.scatter(legs.solve(feet), robot.default_pose))
        np.testing.assert_allclose(turn, np.tile(np.eye(3), (2, 1, 1)), atol=1e-6)

    def test_the_geoms_of_a_foot_belong_to_one_body(self, tmp_path: Path) -> None:
        write_robot(tmp_path, [quadruped_leg("a", 0.2, 0.1), quadruped_leg("b", -0.2, -0.1)])
        edit(tmp_path, "robot.yaml", "- a_foot0", "- a_foot0\n  - shin")
        edit(tmp_path, "robot.xml", '<geom type="capsule"', '<geom name="shin" type="capsule"')
        with pytest.raises(UserError, match="foot a"):
            load_robot(tmp_path)


def test_a_leg_of_two_hinges_beside_one_of_three_moves_as_far_as_it_can(tmp_path: Path) -> None:
    """A leg of two hinges moves only in its plane."""
    hip, knee = (Hinge(PITCH, (0.0, 0.0, -0.2), angle) for angle in (0.5, -0.9))
    legs = write_robot(
        tmp_path, [quadruped_leg("a", 0.2, 0.1), Leg("b", (-0.2, -0.1, 0.0), (hip, knee))]
    ).legs
    jacobian = legs.pose(legs.scatter(legs.default_angles, np.zeros(5))).jacobian
    motion = np.array([[[0.1], [0.2], [0.3]], [[0.1], [0.2], [0.3]]])
    moved = jacobian @ legs.joint_rates(jacobian, motion)
    np.testing.assert_allclose(moved[0], motion[0], atol=1e-3)
    np.testing.assert_allclose(moved[1, :, 0], [0.1, 0.0, 0.3], atol=1e-3)
