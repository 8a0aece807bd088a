"""Limbs of any kind: inverse against forward kinematics, limits, positions out of reach."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from made_up import PITCH, Hinge, Leg, bodies, four_hinge_leg, quadruped_leg, write_robot
from scipy import optimize

from footfall.common.errors import UserError
from footfall.robots.description import Robot, load_robot
from footfall.robots.forward import ForwardKinematics
from footfall.robots.inverse import least_squares
from footfall.robots.least_squares import LeastSquares
from footfall.robots.limb_order import LimbOrder

FIVE, BIPED, SOLES = ("five legs, one of four hinges", "biped without ankles", "six hinges and soles")
KINDS = (FIVE, BIPED, SOLES, "go1")


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Robot]:
    return {**bodies(tmp_path_factory.mktemp("bodies")), "go1": load_robot("go1")}


def near_default(robot: Robot, fraction: np.ndarray, share: float = 0.5) -> np.ndarray:
    """Poses about the default one, in a share of the way to the joint limits."""
    down, up = robot.default_pose - robot.lower_rad, robot.upper_rad - robot.default_pose
    return robot.default_pose + share * np.where(fraction < 0, fraction * down, fraction * up)


def fractions(robot: Robot) -> st.SearchStrategy[np.ndarray]:
    return arrays(float, len(robot.joint_names), elements=st.floats(-1.0, 1.0))


def without_closed_form(robot: Robot) -> LeastSquares:
    """The same limbs, solved by least squares."""
    order = LimbOrder(robot.description)
    return least_squares(
        robot.description, order, ForwardKinematics(robot.description, robot.xml_path, order)
    )


class TestBothForms:
    @pytest.mark.parametrize("name", ["go1", "hexapod"])
    @settings(max_examples=25)
    @given(data=st.data())
    def test_the_same_leg_has_the_same_solution(self, name: str, data: st.DataObject) -> None:
        robot = load_robot(name)
        joint = near_default(robot, data.draw(fractions(robot)), share=0.25)
        tips = robot.legs.pose(joint).foot
        by_hand, by_squares = (
            robot.legs.solve(tips),
            without_closed_form(robot).solve(tips, list(range(robot.legs.count))),
        )
        np.testing.assert_allclose(by_hand, robot.legs.gather(joint), atol=1e-6)
        np.testing.assert_allclose(by_squares, by_hand, atol=1e-5)


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

    def test_nan_affects_its_own_limb_only(self, robots: dict[str, Robot], kind: str) -> None:
        legs = robots[kind].legs
        foot = legs.default_foot.copy()
        foot[-1, 1] = np.nan
        angles = legs.solve(foot)
        own = legs.present[-1]
        assert np.all(np.isnan(angles[-1][own]))
        np.testing.assert_allclose(angles[:-1], legs.default_angles[:-1], atol=1e-6)

    def test_a_limbs_solution_does_not_depend_on_other_limbs(
        self, robots: dict[str, Robot], kind: str
    ) -> None:
        legs = robots[kind].legs
        rng = np.random.default_rng(1)
        foot = legs.default_foot + rng.uniform(-0.03, 0.03, (legs.count, 3))
        chosen = [legs.count - 1, 0]
        np.testing.assert_allclose(legs.solve(foot[chosen], chosen), legs.solve(foot)[chosen], atol=1e-9)

    def test_jacobians_are_derivatives_or_zero(self, robots: dict[str, Robot], kind: str) -> None:
        robot, step = robots[kind], 1e-6
        legs = robot.legs
        rng = np.random.default_rng(2)
        joint = near_default(robot, rng.uniform(-1, 1, len(robot.joint_names)))
        _, jacobian, axes = legs.pose(joint)
        assert not jacobian.transpose(0, 2, 1)[~legs.present].any()
        assert not axes.transpose(0, 2, 1)[~legs.present].any()
        for leg, own in enumerate(robot.foot_joints):
            for column, index in enumerate(own.tolist()):
                nudge = np.zeros_like(joint)
                nudge[index] = step
                slope = (legs.pose(joint + nudge).foot - legs.pose(joint - nudge).foot) / (2 * step)
                np.testing.assert_allclose(jacobian[leg, :, column], slope[leg], atol=1e-7)

    def test_torques_hold_the_forces_at_the_tips(self, robots: dict[str, Robot], kind: str) -> None:
        """By virtual work: in a small motion the joints do the work that the feet do on the ground."""
        robot = robots[kind]
        legs, rng = robot.legs, np.random.default_rng(3)
        joint = near_default(robot, rng.uniform(-1, 1, len(robot.joint_names)))
        force = rng.normal(size=(legs.count, 3))
        torque = legs.scatter(legs.torque(legs.pose(joint).jacobian, force), np.zeros_like(joint))
        rates = rng.normal(size=len(joint))
        moved = (legs.pose(joint + 1e-6 * rates).foot - legs.pose(joint - 1e-6 * rates).foot) / 2e-6
        assert torque @ rates == pytest.approx(-np.sum(force * moved), rel=1e-6)


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
        declaration, xml = tmp_path / "robot.yaml", tmp_path / "robot.xml"
        declaration.write_text(declaration.read_text().replace("- a_foot0", "- a_foot0\n  - shin", 1))
        xml.write_text(xml.read_text().replace('<geom type="capsule"', '<geom name="shin" type="capsule"', 1))
        with pytest.raises(UserError, match="foot a"):
            load_robot(tmp_path)


@pytest.mark.parametrize(
    "away", [(0.25, -0.1, -0.15), (-0.3, 0.2, -0.1), (-0.2, -0.35, 0.2), (0.1, 0.3, -0.3)]
)
def test_out_of_reach_it_is_as_near_as_a_bounded_optimiser(
    robots: dict[str, Robot], away: tuple[float, float, float]
) -> None:
    """scipy's, from the same start."""
    robot = robots[FIVE]
    legs, own = robot.legs, robot.foot_joints[4]
    far = legs.default_foot[4] + np.array(away)

    def missing(angles: np.ndarray) -> np.ndarray:
        joint = robot.default_pose.copy()
        joint[own] = angles
        return legs.pose(joint).foot[4] - far

    bounds = (robot.lower_rad[own], robot.upper_rad[own])
    best = optimize.least_squares(missing, robot.default_pose[own], bounds=bounds)
    left = np.linalg.norm(missing(legs.solve(far[None], [4])[0]))
    assert np.linalg.norm(best.fun) > 0.05  # it is out of reach
    assert left == pytest.approx(np.linalg.norm(best.fun), abs=1e-3)


def test_a_leg_of_two_hinges_beside_one_of_three_moves_as_far_as_it_can(tmp_path: Path) -> None:
    """It moves in its own plane only."""
    hip, knee = (Hinge(PITCH, (0.0, 0.0, -0.2), angle) for angle in (0.5, -0.9))
    legs = write_robot(
        tmp_path, [quadruped_leg("a", 0.2, 0.1), Leg("b", (-0.2, -0.1, 0.0), (hip, knee))]
    ).legs
    jacobian = legs.pose(legs.scatter(legs.default_angles, np.zeros(5))).jacobian
    motion = np.array([[[0.1], [0.2], [0.3]], [[0.1], [0.2], [0.3]]])
    moved = jacobian @ legs.joint_rates(jacobian, motion)
    np.testing.assert_allclose(moved[0], motion[0], atol=1e-3)
    np.testing.assert_allclose(moved[1, :, 0], [0.1, 0.0, 0.3], atol=1e-3)


def test_a_limb_has_the_same_solution_with_and_without_other_limbs(tmp_path: Path) -> None:
    """A limb's solution does not depend on which others the robot has."""
    alone: list[Leg] = [four_hinge_leg("e", -0.02, 0.14)]
    one = write_robot(tmp_path / "one", alone).legs
    two = write_robot(tmp_path / "two", [quadruped_leg("a", 0.2, 0.1), *alone]).legs
    feet = one.default_foot + np.array([0.02, -0.01, 0.03])
    np.testing.assert_allclose(two.solve(feet, [1]), one.solve(feet), atol=1e-9)
