"""Contact follows the force on each foot, and the plan."""

import numpy as np
import pytest
from made_up import BIPED
from moments import UP, readings, under_load

from footfall.deploy.estimation.config import ContactConfig
from footfall.deploy.estimation.contact import ContactEstimator
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot, load_robot
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("go1")
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


@pytest.mark.parametrize(
    ("share", "expected", "trusted"),
    [
        ([1.0, 0.75, 0.65, 0.55], [1.0, 0.55 / 0.6, 0.75, 0.35 / 0.6], True),
        ([0.0, 0.3, np.nan, -9.0], [1.0] * 4, False),  # contradicts the torques
    ],
)
def test_force_sensors_that_agree_are_used(share: list[float], expected: list[float], trusted: bool) -> None:
    sensed = SENSED._replace(foot_force=EVEN * np.array(share))
    contact = begun(ROBOT, sensed)
    np.testing.assert_allclose(after(ROBOT, contact, sensed, 1000), expected, atol=0.01)
    assert contact.trusted.tolist() == [trusted] * 4


def test_a_sensor_that_falls_silent_has_to_prove_itself_again() -> None:
    sensed = SENSED._replace(foot_force=np.full(4, 0.8 * EVEN))
    contact = begun(ROBOT, sensed)
    after(ROBOT, contact, sensed, 1000)
    assert contact.trusted.all()
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
