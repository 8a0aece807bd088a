"""Contact of a walk's feet from the motors' torques."""

import numpy as np
import pytest
from moments import readings as at_rest

from footfall.policies.controllers.walk.ground import GroundForce
from footfall.robots.actuator import friction_torque
from footfall.robots.description import load_robot
from footfall.robots.readings import Sensed
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("hexapod")
LEGS, BODY, POSE = ROBOT.legs, nominal_body(ROBOT), ROBOT.default_pose
JACOBIAN = LEGS.pose(POSE).jacobian
EVEN_N = 9.81 * 3.01 / 6
UP = np.array([0.0, 0.0, 9.81])
DT_S, FILTER_S = 0.004, 0.015
NOTHING = np.zeros(18)


def readings(pushed: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, heavier: float) -> Sensed:
    """Readings of a robot whose motors move the legs and push on the ground with forces (6, 3)."""
    inertial = heavier * BODY.leg_inertia @ LEGS.gather(acceleration)[:, :, None]
    outside = LEGS.holding_torque(POSE, UP) + LEGS.torque(JACOBIAN, pushed) + inertial[:, :, 0]
    torque = LEGS.scatter(outside, NOTHING) - friction_torque(velocity, ROBOT.motor)
    return at_rest(ROBOT, velocity=velocity, torque=torque)


def contact_shares(
    pushed: np.ndarray,
    rate: np.ndarray = NOTHING,
    acceleration: np.ndarray = NOTHING,
    heavier: float = 1.0,
    uncertainty: float = 0.0,
) -> np.ndarray:
    """Shares (6,) after 0.2 s in a force, from rest; the legs' pose is constant."""
    ground = GroundForce(ROBOT, BODY, FILTER_S, uncertainty)
    ground.reset(readings(np.zeros((6, 3)), rate, NOTHING, heavier))
    for tick in range(1, 51):
        velocity = rate + tick * DT_S * acceleration
        shares = ground.update(readings(pushed, velocity, acceleration, heavier), JACOBIAN, DT_S)
    return shares


def feet(**forces: float) -> np.ndarray:
    """Upward forces (6, 3), N, by the feet's names."""
    given = np.zeros((6, 3))
    for foot, force in forces.items():
        given[[each.name for each in ROBOT.description.feet].index(foot), 2] = force
    return given


FALL = np.tile([[0.0], [0.0], [-5.0]], (6, 1, 1))  # m/s^2, of each foot
LOWERING = LEGS.scatter(LEGS.joint_rates(JACOBIAN, FALL)[:, :, 0], NOTHING)  # rad/s^2


def test_gearbox_friction_is_not_mistaken_for_ground() -> None:
    """The gearboxes' friction at 2 rad/s is 0.13 N m: at least a fifth of a share at the foot."""
    np.testing.assert_allclose(contact_shares(feet(), rate=np.full(18, 2.0)), 0.0, atol=0.01)


def test_accelerated_legs_have_contact_only_where_they_touch() -> None:
    """Such an acceleration takes three shares of force at the foot."""
    np.testing.assert_allclose(contact_shares(feet(), acceleration=LOWERING), 0.0, atol=0.05)
    shares = contact_shares(feet(LM=1.5 * EVEN_N), acceleration=LOWERING)
    np.testing.assert_allclose(shares, [0.0, 1.5, 0.0, 0.0, 0.0, 0.0], atol=0.05)


def test_legs_heavier_than_described_have_no_contact_within_the_tolerance() -> None:
    assert contact_shares(feet(), acceleration=LOWERING, heavier=1.2).min() > 0.4
    assert contact_shares(feet(), acceleration=LOWERING, heavier=1.2, uncertainty=0.2) == pytest.approx(
        np.zeros(6), abs=0.05
    )


def test_contact_of_a_braking_leg_is_recognised() -> None:
    """A foot that the ground stops is recognised at once."""
    braked = contact_shares(feet(LM=1.5 * EVEN_N), acceleration=-LOWERING, uncertainty=0.2)
    np.testing.assert_allclose(braked, [0.0, 1.5, 0.0, 0.0, 0.0, 0.0], atol=0.05)
