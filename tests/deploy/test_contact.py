"""Contact follows the force on each foot; spheres and soles touch the ground with their lowest points."""

import numpy as np
import pytest
from made_up import BIPED
from moments import UP, about, readings, under_load

from footfall.deploy.estimation.config import ContactConfig
from footfall.deploy.estimation.contact import ContactEstimator
from footfall.deploy.estimation.feet import ContactPoints
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot, load_robot
from footfall.robots.rigid_body import nominal_body

ROBOT, G1 = load_robot("go1"), load_robot("g1")
EVEN = 9.81 * nominal_body(ROBOT).mass / 4
SENSED = under_load(ROBOT, np.outer(np.full(4, EVEN), UP))


def begun(robot: Robot, sensed: Sensed) -> ContactEstimator:
    contact = ContactEstimator(robot.legs, nominal_body(robot), ContactConfig())
    contact.reset(sensed)
    return contact


def after(robot: Robot, contact: ContactEstimator, sensed: Sensed, ticks: int) -> np.ndarray:
    rates = robot.legs.gather(sensed.joint_velocity)
    jacobian = robot.legs.pose(sensed.joint_position).jacobian
    for _ in range(ticks):
        found = contact.update(sensed, rates, jacobian, UP, None, 0.002)
    return np.array(found)


def test_force_sensors_that_agree_are_used() -> None:
    """A sensor that falls silent has to prove itself again."""
    for share, expected, trusted in (
        ([1.0, 0.75, 0.65, 0.55], [1.0, 0.55 / 0.6, 0.75, 0.35 / 0.6], True),
        ([0.0, 0.3, np.nan, -9.0], [1.0] * 4, False),  # contradicts the torques
    ):
        sensed = SENSED._replace(foot_force=EVEN * np.array(share))
        contact = begun(ROBOT, sensed)
        np.testing.assert_allclose(after(ROBOT, contact, sensed, 1000), expected, atol=0.01)
        assert contact.trusted.tolist() == [trusted] * 4
        after(ROBOT, contact, sensed._replace(foot_force=np.full(4, np.nan)), 200)
        assert not contact.trusted.any()


@pytest.mark.parametrize("name", ["go1", "hexapod"])
@pytest.mark.parametrize(("share", "trust"), [(0.15, 0.0), (0.5, 0.5), (0.8, 1.0), (1.5, 1.0)])
def test_trust_follows_the_force_on_the_foot(name: str, share: float, trust: float) -> None:
    """Trust is 0 below 0.2 of an equal share of the weight, 1 above 0.8, and 0.5 in the middle."""
    robot = load_robot(name)
    even = 9.81 * nominal_body(robot).mass / robot.legs.count
    sensed = under_load(robot, np.tile(share * even * UP, (robot.legs.count, 1)))
    np.testing.assert_allclose(after(robot, begun(robot, sensed), sensed, 200), trust, atol=0.01)


def test_a_stretched_leg_does_not_stop_the_estimate(bodies: dict[str, Robot]) -> None:
    """If all links are in a line, no torque depends on a force along the line."""
    robot = bodies[BIPED]
    straight = readings(robot, joint=np.zeros(6))
    assert np.linalg.matrix_rank(robot.legs.pose(straight.joint_position).jacobian[0]) == 2
    assert np.isfinite(after(robot, begun(robot, straight), straight, 3)).all()


def test_trust_rises_slowly_and_falls_quickly() -> None:
    """After one time constant of 30 ms trust is 63 %. After the end of the force it falls sooner."""
    standing, hanging = (under_load(ROBOT, np.tile(f * UP, (4, 1))) for f in (40.0, 0.0))
    contact = begun(ROBOT, standing)
    contact.probability = [0.0] * 4
    assert after(ROBOT, contact, standing, 15)[2] == pytest.approx(1 - np.exp(-1), abs=0.01)
    after(ROBOT, contact, standing, 200)
    assert after(ROBOT, contact, hanging, 2)[2] > 0.8
    assert after(ROBOT, contact, hanging, 8)[2] == 0.0


class TestContactPoints:
    def test_a_sphere_touches_with_its_lowest_point(self) -> None:
        """Pitched or rolled, a sphere touches the ground below its centre."""
        up = about("x", 0.4).T @ UP
        arms = ContactPoints(ROBOT.legs, 0.002).arms(ROBOT.default_pose, up)
        np.testing.assert_allclose(arms, -0.023 * np.tile(up, (4, 1)))

    def test_a_sole_touches_with_its_low_edge(self) -> None:
        """Corners are 0.085 m ahead of the sole's middle and behind it, 0.03 and 0.025 m to the sides."""
        for axis, angle, expected in (
            ("y", 0.0, [0.0, 0.0]),  # level: below its middle
            ("y", 0.06, [0.085, 0.0]),  # nose down: the toes
            ("y", -0.06, [-0.085, 0.0]),  # nose up: the heel
            ("x", 0.3, [0.0766, -0.0297]),  # rolled: the edge, which is 1.48 mm higher at the heel
        ):
            up = about(axis, angle).T @ UP
            arms = ContactPoints(G1.legs, 0.0005).arms(G1.default_pose, up)
            atol = 1e-3 if angle else 1e-6
            np.testing.assert_allclose(arms[:, :2] + 0.005 * up[:2], [expected] * 2, atol=atol)
            assert angle or arms[:, 2] == pytest.approx([-0.005] * 2, abs=1e-6)

    def test_soles_follow_their_ankles(self) -> None:
        """The base level, ankles bent by 0.1 rad: one foot on its toes, one on its heel."""
        pose = G1.default_pose.copy()
        left, right = (G1.joint_index(f"{side}_ankle_pitch_joint") for side in ("left", "right"))
        pose[left], pose[right] = pose[left] + 0.1, pose[right] - 0.1
        arms = ContactPoints(G1.legs, 0.001).arms(pose, UP)
        np.testing.assert_allclose(arms[:, 0], [0.085 * np.cos(0.1), -0.085 * np.cos(0.1)], atol=1e-4)
