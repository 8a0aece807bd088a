"""A learned policy from readings to joint targets, with a network that answers to everything it sees."""

from pathlib import Path

import numpy as np
import pytest
from tiny_policy import write_network

from footfall.policies.contract import Contract
from footfall.policies.learned import LearnedPolicy
from footfall.policies.observation import frame_size, observation_size
from footfall.policies.policy import Observation, Sensed
from footfall.robots.description import Robot

onnx = pytest.importorskip("onnx")
STEPS = 9


@pytest.fixture
def policy(tmp_path: Path, contract: Contract, go1: Robot) -> LearnedPolicy:
    rng = np.random.default_rng(0)
    weights = 0.1 * rng.standard_normal((observation_size(contract), len(contract.joints)))
    return LearnedPolicy(write_network(onnx, tmp_path / "p.onnx", weights.astype(np.float32), contract), go1)


def observations(seed: int) -> list[Observation]:
    rng = np.random.default_rng(seed)
    quaternion = np.array([1.0, 0.0, 0.0, 0.0])
    return [
        Observation(
            step / 50,
            Sensed(rng.normal(size=3), rng.normal(size=3), quaternion, *rng.normal(size=(3, 12))),
            np.array([0.5, 0.1, -0.2]),
            np.zeros(3),
            0.28,
        )
        for step in range(STEPS)
    ]


def episode(policy: LearnedPolicy, seed: int = 1) -> np.ndarray:
    seen = observations(seed)
    policy.reset(seen[0])
    return np.array([policy.act(each) for each in seen])


def test_a_second_episode_is_the_first_to_the_bit(policy: LearnedPolicy) -> None:
    """Clock, last action and history start anew."""
    first = episode(policy)
    episode(policy, seed=2)
    np.testing.assert_array_equal(episode(policy), first)


def test_history_begins_with_the_first_reading(policy: LearnedPolicy, contract: Contract) -> None:
    """As in training: the frames of before the beginning are copies of the first."""
    seen = observations(1)[0]
    policy.reset(seen)
    policy.act(seen)
    gyro = contract.observation[0].scale * seen.sensed.gyro
    np.testing.assert_allclose(policy.observed[:6], [*gyro, *gyro], rtol=1e-6)


def test_the_clock_starts_at_zero_and_runs_at_the_gaits_frequency(policy: LearnedPolicy) -> None:
    """Sine and cosine of the phase end the observation: 2.2 Hz seen at 50 Hz is 0.044 cycles a step."""
    seen = observations(1)
    policy.reset(seen[0])
    for step, each in enumerate(seen):
        policy.act(each)
        angle = 2 * np.pi * 0.044 * step
        np.testing.assert_allclose(policy.observed[-2:], [np.sin(angle), np.cos(angle)], atol=1e-6)


def test_it_sees_the_action_that_it_took_last(policy: LearnedPolicy, contract: Contract) -> None:
    seen = observations(1)
    policy.reset(seen[0])
    policy.act(seen[0])
    taken = policy.action.copy()
    policy.act(seen[1])
    np.testing.assert_allclose(policy.observed[-2 - 12 : -2], taken, rtol=1e-6)
    assert frame_size(contract) == 3 + 3 + 3 + 12 + 12 + 12 + 2


def test_its_command_is_a_target_under_the_contracts_gains(policy: LearnedPolicy, contract: Contract) -> None:
    """With no reference gait, the target is the default pose and the scaled action."""
    seen = observations(1)[0]._replace(command=np.zeros(3))
    policy.reset(seen)
    command = policy.act(seen)
    scaled = np.array(contract.action_scale_rad) * policy.action
    np.testing.assert_allclose(command.position, np.array(contract.default_pose_rad) + scaled, rtol=1e-6)
    np.testing.assert_array_equal(command.kp, contract.kp)
    np.testing.assert_array_equal(command.kd, contract.kd)
    np.testing.assert_array_equal([command.velocity, command.torque], 0.0)


def test_actions_are_added_to_the_reference_gait(policy: LearnedPolicy, contract: Contract) -> None:
    """At the sixth step the clock shows 0.22 cycles: feet of phase 0 are lifted by sin(2 pi 0.22)."""
    seen = observations(1)
    policy.reset(seen[0])
    for each in seen[:6]:
        command = policy.act(each)
    scaled = np.array(contract.action_scale_rad) * policy.action
    reference = (command.position - np.array(contract.default_pose_rad) - scaled).reshape(4, 3)
    lifted = np.sin(2 * np.pi * 0.22) * np.array([0.0, 0.3, -0.6])
    np.testing.assert_allclose(reference, [lifted, np.zeros(3), np.zeros(3), lifted], atol=1e-6)
