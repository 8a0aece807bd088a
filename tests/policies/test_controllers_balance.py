"""Targets of `Balance` at single times, calculated by hand."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from moments import policy_input, whole_body_arguments
from scipy.spatial.transform import Rotation

from footfall.policies.controllers.balance import Balance, BalanceConfig
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.whole_body.feedback import Feedback
from footfall.policies.policy import PolicyInput
from footfall.robots.description import load_robot

G1 = load_robot("g1")
N = len(G1.joint_names)
CONFIG = replace(
    controller_settings(G1, "balance", BalanceConfig),
    capture_gain=0.5,
    max_lead_m=0.2,
    height=Feedback(60.0, 15.0),
    attitude=Feedback(100.0, 20.0),
    posture=Feedback(40.0, 12.0),
    momentum_damping=2.0,
    max_force=1.2,
    settle_s=0.5,
)


@pytest.fixture(scope="module")
def policy() -> Balance:
    return Balance(G1, CONFIG)


def seen(time_s: float = 9.0, crouch: float = 0.0, **more: Any) -> PolicyInput:
    """A level robot whose joints differ from their default pose by different angles."""
    joint = G1.default_pose + crouch * np.linspace(0.01, 0.2, N)
    return policy_input(G1, time_s, base_height=0.7, joint=joint, **more)


class TestCentre:
    """The desired acceleration of the centre of mass."""

    def at(self, policy: Balance, offset: Any, velocity: Any) -> np.ndarray:
        """Feet 0.3 m apart, whose middle is not at the origin."""
        foot = np.array([[1.0, 0.15, 0.2], [1.0, -0.15, 0.2]])
        centre = np.add(offset, (1.0, 0.0, 0.2))
        dynamics = SimpleNamespace(
            centre=centre, middle=foot.mean(axis=0), centre_velocity=np.array(velocity)
        )
        return policy._centre_acceleration(dynamics, 0.6)  # type: ignore[arg-type]

    def test_the_pressure_lies_beyond_the_capture_point_within_its_limit(self, policy: Balance) -> None:
        """Capture point x = c + v / w, pressure p = 1.5 x up to 0.2 m, and acceleration w^2 (c - p)."""
        rate = math.sqrt(9.81 / policy.com_height_m)
        capture = np.array([0.02 + 0.1 / rate, -0.01 - 0.05 / rate])
        expected = rate**2 * (np.array([0.02, -0.01]) - 1.5 * capture)
        found = self.at(policy, (0.02, -0.01, 0.6), (0.1, -0.05, 0.0))
        np.testing.assert_allclose(found, [*expected, 0.0], atol=1e-12)
        fast = np.array([1.2, 0.5, 0.0])  # a fall forward and a little to the left
        found = self.at(policy, (0.0, 0.0, 0.6), fast)
        np.testing.assert_allclose(found[:2], -(rate**2) * 0.2 * fast[:2] / 1.3)


class TestAct:
    def test_a_tilted_base_is_turned_back(self, policy: Balance, monkeypatch: pytest.MonkeyPatch) -> None:
        """The acceleration is -100 tilt - 20 rate; roll is 0.02 rad, pitch -0.03 rad."""
        tilted = seen(turn=Rotation.from_rotvec([0.02, -0.03, 0.0]), gyro=(0.1, 0.2, -0.3))
        *_, desired, _ = whole_body_arguments(policy, monkeypatch, tilted)
        np.testing.assert_allclose(desired.attitude, [-2.0 - 2.0, 3.0 - 4.0, 6.0], atol=0.05)

    def test_angular_momentum_is_damped(self, policy: Balance, monkeypatch: pytest.MonkeyPatch) -> None:
        spinning = seen(gyro=np.array([0.3, -0.2, 0.1]))
        dynamics, *_, desired, _ = whole_body_arguments(policy, monkeypatch, spinning)
        np.testing.assert_allclose(desired.momentum_rate, -2.0 * dynamics.angular_momentum)

    def test_after_a_reset_the_pose_is_reached_in_time(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """After a fifth of the time the targets have moved by a fifth, in joints and height."""
        policy = Balance(G1, CONFIG)
        crouched = seen(0.0, crouch=1.0)
        policy.reset(crouched)
        off = np.linspace(0.01, 0.2, N)
        crouched.sensed.joint_position[:] = 99.0
        for time_s, share in ((0.0, 0.0), (0.1, 0.2), (0.5, 1.0), (3.0, 1.0)):
            dynamics, *_, desired, _ = whole_body_arguments(policy, monkeypatch, seen(time_s, crouch=1.0))
            np.testing.assert_allclose(desired.joints, -40.0 * share * off, atol=1e-9)
            low = float((dynamics.centre - dynamics.foot.mean(axis=0))[2]) - policy.com_height_m
            assert desired.centre[2] == pytest.approx(-60.0 * share * low)
            assert abs(low) > 1e-3

    def test_both_feet_stand_and_a_reset_clears_the_counters(self, policy: Balance) -> None:
        stance = policy.stance()
        assert stance is not None
        assert stance.tolist() == [1.0, 1.0]
        assert (policy.rate_hz, policy.needs_estimate) == (CONFIG.rate_hz, True)
        policy.control.unsolved_ticks = 3
        policy.reset(seen())
        assert policy.control.unsolved_ticks == 0
