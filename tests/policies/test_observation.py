"""The observation with its height scan, and the action: as the contract says, the same for NumPy and JAX."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from footfall.common.errors import UserError
from footfall.policies.action import gait_reference, joint_target
from footfall.policies.contract import Contract, Term
from footfall.policies.height_scan import HeightScan, common_height_scan
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
    term_kind,
    term_size,
)

RNG = np.random.default_rng(12)
COMMAND = np.array([0.3, -0.2, 0.1])


def random_inputs(rng: np.random.Generator, shape: tuple[int, ...] = ()) -> Inputs:
    sizes = {"gyro": 3, "gravity": 3, "joint_position": 12, "joint_velocity": 12}
    normal = {name: rng.normal(size=(*shape, size)).astype(np.float32) for name, size in sizes.items()}
    return Inputs(normal, *(rng.normal(size=(*shape, size)).astype(np.float32) for size in (12, 3, 1)))


def history(inputs: list[Inputs], contract: Contract, xp) -> object:
    """The observation after these inputs, in either array library."""
    steps = [step_values(jax.tree.map(xp.asarray, each), contract) for each in inputs]
    frames = xp.stack([steps[0]] * history_length(contract), axis=-2)
    for newest in steps:
        frames = push_history(frames, newest)
    return observation(frames, contract)


@pytest.mark.parametrize("shape", [(), (4,)])
def test_numpy_and_jax_agree_on_observation_and_target(contract: Contract, shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    inputs = [random_inputs(rng, shape) for _ in range(5)]
    in_numpy, in_jax = (history(inputs, contract, xp) for xp in (np, jnp))
    assert (in_numpy.dtype, in_numpy.shape) == (np.float32, (*shape, observation_size(contract)))
    np.testing.assert_allclose(in_numpy, in_jax, rtol=2e-6, atol=2e-7)
    sizes = {"action": 12, "phase": 1, "command": 3}
    given = [rng.normal(size=(*shape, size)).astype(np.float32) for size in sizes.values()]
    in_jax = joint_target(*map(jnp.asarray, given), contract)
    np.testing.assert_allclose(joint_target(*given, contract), in_jax, rtol=2e-6, atol=1e-6)


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


def test_an_observation_of_three_frames_by_hand(contract: Contract) -> None:
    """Scales and histories all differ, and the clock is at a phase where sine and cosine differ."""
    terms = (Term("joint_velocity", 0.05, 2), Term("clock", 3.0, 1), Term("command", -2.0, 3))
    contract = replace(contract, observation=terms)
    frames, moments = np.zeros((history_length(contract), 12 + 2 + 3)), []
    for scale in (1.0, 2.0, 3.0):
        moments.append(random_inputs(RNG)._replace(command=scale * COMMAND, phase=np.array([0.15 * scale])))
        frames = push_history(frames, step_values(moments[-1], contract))
    velocities = [0.05 * moment.readings["joint_velocity"] for moment in moments[1:]]
    clock = 3.0 * np.array([np.sin(2 * np.pi * 0.45), np.cos(2 * np.pi * 0.45)])
    expected = np.concatenate([*velocities, clock, *(-2.0 * moment.command for moment in moments)])
    np.testing.assert_allclose(observation(frames, contract), expected, atol=1e-6)


def test_the_clock_is_zero_while_the_command_is_to_stand(contract: Contract) -> None:
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
def test_moving_is_a_norm_of_all_axes(contract: Contract, command: Any, expected: float) -> None:
    assert contract.standing_command == 0.1
    assert moving(np.array(command, dtype=float), contract).tolist() == [expected]
    assert moving(np.zeros(3), replace(contract, standing_command=0.0)).tolist() == [1.0]


def test_targets_by_hand(contract: Contract) -> None:
    action, command, clock = RNG.normal(size=12), np.array([0.5, 0.0, 0.0]), np.array([0.37])
    phase, amplitude, scale = RNG.uniform(size=12), RNG.normal(size=12), RNG.uniform(0.1, 1.0, 12)
    assert contract.gait is not None
    gait = replace(contract.gait, phase=tuple(phase), amplitude_rad=tuple(amplitude))
    contract = replace(contract, gait=gait, action_scale_rad=tuple(scale))
    reference = amplitude * np.maximum(np.sin(2 * np.pi * (0.37 + phase)), 0.0)
    np.testing.assert_allclose(gait_reference(clock, command, contract), reference, atol=1e-12)
    expected = np.array(contract.default_pose_rad) + reference + scale * action
    np.testing.assert_allclose(joint_target(action, clock, command, contract), expected, atol=1e-12)
    assert not gait_reference(clock, np.zeros(3), contract).any()
    shorter = replace(contract, gait=replace(gait, duty=0.8))
    swing = (0.37 + phase) % 1.0 / 0.2
    reference = np.where(swing < 1.0, amplitude * np.sin(np.pi * swing), 0.0)
    np.testing.assert_allclose(gait_reference(clock, command, shorter), reference, atol=1e-12)
    without, single = replace(contract, gait=None), clock.astype(np.float32)
    assert gait_reference(single, command.astype(np.float32), contract).dtype == np.float32
    assert gait_reference(single, command, without).dtype == np.float32
    still = gait_reference(np.zeros((5, 1)), np.ones((5, 3)), without)
    np.testing.assert_array_equal(still, np.zeros((5, 12)))


SCAN = HeightScan(forward_m=(-0.2, 0.4), leftward_m=0.2, spacing_m=0.1)
SETTINGS = {"forward_m": [-0.2, 0.4], "leftward_m": 0.2, "spacing_m": 0.1}


@pytest.fixture
def seeing(contract: Contract) -> Contract:
    return replace(contract, observation=(Term("height_scan", 2.0, settings=SETTINGS),))


def scanned(contract: Contract, heights: np.ndarray | None) -> np.ndarray:
    return step_values(Inputs({}, np.zeros(12), np.zeros(3), np.zeros(1), heights), contract)


def test_points_lie_from_back_to_front_and_from_right_to_left() -> None:
    assert SCAN.size == len(SCAN.points) == 7 * 5
    expected = [[-0.2, -0.2], [-0.2, -0.1], [-0.1, -0.2], [0.4, 0.2]]
    np.testing.assert_allclose(SCAN.points[[0, 1, 5, -1]], expected)


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-3.1, 3.1))
def test_positions_rotate_with_the_heading(x: float, y: float, yaw: float) -> None:
    points = SCAN.positions(np.array([x, y, 0.3]), np.float64(yaw))
    ahead = points[-3] - points[-8]  # the middle of the first row minus that of the second
    np.testing.assert_allclose(ahead, 0.1 * np.array([np.cos(yaw), np.sin(yaw)]), atol=1e-9)
    leftward = points[-1] - points[-2]
    np.testing.assert_allclose(leftward, 0.1 * np.array([-np.sin(yaw), np.cos(yaw)]), atol=1e-9)


def test_a_policy_observes_scaled_clipped_heights_and_the_presence_of_a_scan(seeing: Contract) -> None:
    heights = np.linspace(-0.6, 0.2, SCAN.size)
    numbers = scanned(seeing, heights)
    assert len(numbers) == term_size(seeing.observation[0], seeing) == SCAN.size + 1
    np.testing.assert_allclose(numbers, [*(2.0 * heights), 2.0])
    clipped = scanned(seeing, np.where(np.arange(SCAN.size) < 3, -7.0, 3.0))
    np.testing.assert_allclose(clipped[[0, -2]], [-2.0, 1.0])
    heights[2:] = np.nan  # unknown points take the mean of the others
    np.testing.assert_allclose(scanned(seeing, heights)[2:-1], 2.0 * heights[:2].mean())
    for nothing in (None, np.full(SCAN.size, np.nan)):  # a lost scan
        np.testing.assert_array_equal(scanned(seeing, nothing), np.zeros(SCAN.size + 1))


def test_numpy_and_jax_agree_on_a_scan(seeing: Contract) -> None:
    heights = np.random.default_rng(0).normal(size=(4, SCAN.size)).astype(np.float32)
    heights[1, :9] = np.nan
    in_numpy = step_values(Inputs({}, *np.zeros((3, 4, 3), np.float32), heights), seeing)
    in_jax = step_values(Inputs({}, *jnp.zeros((3, 4, 3)), jnp.asarray(heights)), seeing)
    assert in_numpy.dtype == np.float32
    np.testing.assert_allclose(in_numpy, in_jax, rtol=1e-5)


def test_mirrored_ground_gives_the_mirrored_observation(seeing: Contract) -> None:
    sides = (SCAN.points * [1.0, side] for side in (1.0, -1.0))
    plain, other = (scanned(seeing, 0.1 * x + 0.3 * y + y**3) for x, y in (points.T for points in sides))
    mirror = term_kind(seeing.observation[0]).mirror(None)  # type: ignore[arg-type]
    np.testing.assert_allclose(mirror(plain), other)


@pytest.mark.parametrize(
    "wrong",
    [
        *({"spacing_m": 0.0}, {"forward_m": [0.5, -0.5]}, {"clip_m": [0.5, float("nan")]}),
        *({"spacing_m": 0.01, "forward_m": [-2.0, 2.0]}, {"max_age_s": 0.01}, {"width_m": 1.0}),
    ],
)
def test_an_invalid_scan_setting_is_refused_by_name(seeing: Contract, wrong: dict[str, object]) -> None:
    with pytest.raises(UserError, match="height_scan|" + next(iter(wrong))):
        term_size(Term("height_scan", settings=SETTINGS | wrong), seeing)


def test_policies_of_one_run_must_agree_on_the_scan(contract: Contract, seeing: Contract) -> None:
    assert common_height_scan([None, contract]) is None
    assert common_height_scan([contract, seeing, seeing]) == SCAN
    other = replace(seeing, observation=(Term("height_scan", settings={"spacing_m": 0.2}),))
    with pytest.raises(UserError):
        common_height_scan([seeing, other])
