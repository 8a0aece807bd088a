"""The MPC's plan carried out by whole-body control."""

from functools import partial
from typing import Any

import numpy as np
import pytest
from direct_plant import DirectPlant, walk
from moments import policy_input
from scipy.spatial.transform import Rotation

from footfall.policies.controllers.mpc.whole_body import MpcWholeBody
from footfall.policies.controllers.whole_body.dynamics import Dynamics
from footfall.policies.controllers.whole_body.problem import Desired
from footfall.policies.policy import PolicyInput
from footfall.policies.registry import load_policy
from footfall.robots.actuator import JointCommand
from footfall.robots.description import load_robot
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("go1")
LEGS, BODY = ROBOT.legs, nominal_body(ROBOT)
TILTED = Rotation.from_euler("ZYX", [0.9, -0.2, 0.15])
GYRO, VELOCITY = np.array([0.3, -0.5, 0.8]), np.array([0.3, -0.2, 0.1])
RATES = 0.3 * np.random.default_rng(1).standard_normal(len(ROBOT.joint_names))


def hold(command: tuple[float, float, float], _: float) -> np.ndarray:
    return np.array(command)


def moving() -> PolicyInput:
    """Inputs of a tilted robot in its default pose, with base and joints in motion."""
    return policy_input(
        ROBOT, base_velocity=VELOCITY, base_height=0.26, turn=TILTED, gyro=GYRO, velocity=RATES
    )


@pytest.fixture
def policy() -> MpcWholeBody:
    policy = load_policy("mpc-wbc", ROBOT)
    assert isinstance(policy, MpcWholeBody)
    return policy


Call = tuple[Dynamics, Desired, np.ndarray]


@pytest.fixture
def recorded(policy: MpcWholeBody, monkeypatch: pytest.MonkeyPatch) -> list[Call]:
    """Arguments of whole-body control: dynamics, accelerations, and maximum forces at points."""
    calls: list[Call] = []
    command = policy.control.command

    def seen(*arguments: Any) -> JointCommand:
        dynamics, _, _, desired, max_force = arguments
        calls.append((dynamics, desired, max_force))
        return command(*arguments)

    monkeypatch.setattr(policy.control, "command", seen)
    return calls


def test_the_body_moves_as_forces_move_it(policy: MpcWholeBody, recorded: list[Call]) -> None:
    """The motion fulfils Newton's and Euler's equations of the rigid body that the plan is made for."""
    policy.reset(moving())
    policy.act(moving())
    dynamics, desired, max_force = recorded[0]
    np.testing.assert_array_equal(max_force, policy._config.contact.max_force_n)
    force = policy.force
    np.testing.assert_allclose(desired.centre, force.sum(axis=0) / BODY.mass - [0, 0, 9.81])
    moment = np.cross(dynamics.foot - dynamics.centre, force).sum(axis=0)
    assert np.abs(moment).min() > 0.1
    np.testing.assert_allclose(desired.momentum_rate, moment)
    turned = TILTED.as_matrix() @ BODY.inertia @ TILTED.as_matrix().T
    np.testing.assert_allclose(TILTED.apply(desired.attitude), np.linalg.solve(turned, moment))


def test_it_walks_as_commanded(policy: MpcWholeBody) -> None:
    result = walk(policy, DirectPlant(ROBOT, seed=2), partial(hold, (0.4, -0.1, 0.5)), 3.0)
    assert not result.fell
    assert policy.control.unsolved_ticks == 0
    assert policy.notes == ()
    np.testing.assert_allclose(result.mean_velocity(after_s=1.5), [0.4, -0.1, 0.5], atol=0.04)


def test_after_a_reset_the_episode_repeats_itself(policy: MpcWholeBody) -> None:
    policy.reset(moving())
    first = [policy.act(moving()).position.tolist() for _ in range(3)]
    policy.reset(moving())
    assert [policy.act(moving()).position.tolist() for _ in range(3)] == first
