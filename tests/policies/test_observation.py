"""The observation and the action: the same for NumPy and JAX, in the contract's layout."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.policies.action import gait_reference, joint_target
from footfall.policies.contract import Contract, Term
from footfall.policies.observation import (
    TERMS,
    Inputs,
    history_length,
    moving,
    observation,
    observation_size,
    push_history,
    size_per_step,
    step_values,
    term_size,
)

STEPS, BATCH = 5, (4,)


def random_inputs(rng: np.random.Generator, shape: tuple[int, ...] = ()) -> Inputs:
    def normal(size: int) -> np.ndarray:
        return rng.normal(size=(*shape, size)).astype(np.float32)

    sizes = {"gyro": 3, "gravity": 3, "joint_position": 12, "joint_velocity": 12}
    readings = {name: normal(size) for name, size in sizes.items()}
    return Inputs(readings, normal(12), normal(3), normal(1))


def history(inputs: list[Inputs], contract: Contract, xp) -> object:
    """The observation after these inputs, in either array library."""
    frames = None
    for each in inputs:
        newest = step_values(jax.tree.map(xp.asarray, each), contract)
        if frames is None:
            frames = xp.stack([newest] * history_length(contract), axis=-2)
        frames = push_history(frames, newest)
    return observation(frames, contract)


@pytest.mark.parametrize("shape", [(), BATCH])
def test_numpy_and_jax_agree_on_observation_and_target(contract: Contract, shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    inputs = [random_inputs(rng, shape) for _ in range(STEPS)]
    in_numpy = history(inputs, contract, np)
    in_jax = history(inputs, contract, jnp)
    assert in_numpy.dtype == np.float32
    assert in_numpy.shape == (*shape, observation_size(contract))
    np.testing.assert_allclose(in_numpy, in_jax, rtol=2e-6, atol=2e-7)
    action, phase, command = (rng.normal(size=(*shape, k)).astype(np.float32) for k in (12, 1, 3))
    in_numpy = joint_target(action, phase, command, contract)
    in_jax = joint_target(jnp.asarray(action), jnp.asarray(phase), jnp.asarray(command), contract)
    np.testing.assert_allclose(in_numpy, in_jax, rtol=2e-6, atol=1e-6)


@pytest.mark.parametrize("name", TERMS)
def test_each_term_has_its_declared_size_and_scale(contract: Contract, name: str) -> None:
    inputs = random_inputs(np.random.default_rng(3))
    plain = step_values(inputs, replace(contract, observation=(Term(name),)))
    scaled = step_values(inputs, replace(contract, observation=(Term(name, 2.0),)))
    assert plain.shape == (term_size(Term(name), contract),)
    np.testing.assert_array_equal(scaled, 2.0 * plain)


def test_sizes_and_values_of_terms(contract: Contract) -> None:
    """Joint positions are relative to the default pose."""
    assert size_per_step(contract) == 3 + 3 + 3 + 12 + 12 + 12 + 2
    assert observation_size(contract) == 2 * 3 + 3 + 3 + 3 * 12 + 3 * 12 + 2 * 12 + 2
    assert history_length(contract) == 3
    inputs = random_inputs(np.random.default_rng(5))
    readings = inputs.readings | {"joint_position": np.array(contract.default_pose_rad)}
    seen = replace(contract, observation=(Term("joint_position"),))
    np.testing.assert_array_equal(step_values(inputs._replace(readings=readings), seen), np.zeros(12))
    with pytest.raises(UserError, match=r"base_velocity.*gyro"):
        term_size(Term("base_velocity"), contract)


RNG = np.random.default_rng(12)
COMMAND = np.array([0.3, -0.2, 0.1])


class TestObservation:
    def test_three_frames_by_hand(self, contract: Contract) -> None:
        """Scales and histories all differ, and the clock is at a phase where sine and cosine differ."""
        terms = (Term("joint_velocity", 0.05, 2), Term("clock", 3.0, 1), Term("command", -2.0, 3))
        contract = replace(contract, observation=terms)
        moments = [
            random_inputs(RNG)._replace(command=scale * COMMAND, phase=np.array([0.15 * scale]))
            for scale in (1.0, 2.0, 3.0)
        ]
        frames = np.zeros((history_length(contract), 12 + 2 + 3))
        for moment in moments:
            frames = push_history(frames, step_values(moment, contract))
        angle = 2 * np.pi * 0.45
        expected = np.concatenate(
            [
                0.05 * moments[1].readings["joint_velocity"],
                0.05 * moments[2].readings["joint_velocity"],
                [3.0 * np.sin(angle), 3.0 * np.cos(angle)],
                *(-2.0 * moment.command for moment in moments),
            ]
        )
        np.testing.assert_allclose(observation(frames, contract), expected, atol=1e-6)

    def test_the_clock_is_zero_while_the_command_is_to_stand(self, contract: Contract) -> None:
        contract = replace(contract, observation=(Term("clock"),))
        moment = random_inputs(RNG)._replace(command=COMMAND, phase=np.array([0.3]))
        angle = 2 * np.pi * 0.3
        np.testing.assert_allclose(step_values(moment, contract), [np.sin(angle), np.cos(angle)])
        still = moment._replace(command=np.array([0.0, 0.05, 0.0]))
        np.testing.assert_array_equal(step_values(still, contract), [0.0, 0.0])

    @pytest.mark.parametrize(
        ("command", "expected"),
        [((0.06, 0.0, 0.08), 1.0), ((0.0, -0.0999, 0.0), 0.0), ((-0.07, 0.06, -0.05), 1.0), ((0, 0, 0), 0.0)],
    )
    def test_moving_is_a_norm_of_all_axes(self, contract: Contract, command: Any, expected: float) -> None:
        assert contract.standing_command == 0.1
        assert moving(np.array(command, dtype=float), contract).tolist() == [expected]
        assert moving(np.zeros(3), replace(contract, standing_command=0.0)).tolist() == [1.0]

    def test_targets_by_hand(self, contract: Contract) -> None:
        action, command = RNG.normal(size=12), np.array([0.5, 0.0, 0.0])
        phase = RNG.uniform(size=12)
        amplitude = RNG.normal(size=12)
        assert contract.gait is not None
        gait = replace(contract.gait, phase=tuple(phase), amplitude_rad=tuple(amplitude))
        contract = replace(contract, gait=gait, action_scale_rad=tuple(RNG.uniform(0.1, 1.0, 12)))
        clock = np.array([0.37])
        wave = np.sin(2 * np.pi * (0.37 + phase))
        reference = np.where(wave > 0, amplitude * wave, 0.0)
        np.testing.assert_allclose(gait_reference(clock, command, contract), reference, atol=1e-12)
        expected = np.array(contract.default_pose_rad) + reference
        expected += np.array(contract.action_scale_rad) * action
        np.testing.assert_allclose(joint_target(action, clock, command, contract), expected, atol=1e-12)
        assert not gait_reference(clock, np.zeros(3), contract).any()
        shorter = replace(contract, gait=replace(gait, duty=0.8))
        swing = (0.37 + phase) % 1.0 / 0.2
        reference = np.where(swing < 1.0, amplitude * np.sin(np.pi * swing), 0.0)
        np.testing.assert_allclose(gait_reference(clock, command, shorter), reference, atol=1e-12)
        single = gait_reference(clock.astype(np.float32), command.astype(np.float32), contract)
        assert single.dtype == np.float32
        none = gait_reference(clock.astype(np.float32), command, replace(contract, gait=None))
        assert none.dtype == np.float32
        still = gait_reference(np.zeros((5, 1)), np.ones((5, 3)), replace(contract, gait=None))
        assert still.shape == (5, 12)
        assert not still.any()
