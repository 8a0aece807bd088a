"""Rotations, indices that NumPy reads without a copy, and linear equations, alone and in batches."""

import itertools
from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from footfall.common import rotations
from footfall.common.arrays import as_slice
from footfall.common.linear import solve

RNG = np.random.default_rng(0)
QUATERNIONS = RNG.normal(size=(6, 4))
QUATERNIONS /= np.linalg.norm(QUATERNIONS, axis=1, keepdims=True)
VECTORS = RNG.normal(size=(6, 3))
TURNS = Rotation.from_quat(QUATERNIONS, scalar_first=True)
PRODUCTS = (TURNS * TURNS[::-1]).as_quat(scalar_first=True)


@pytest.mark.parametrize(
    ("function", "arguments", "expected"),
    [
        (rotations.rotation_matrix, (QUATERNIONS,), TURNS.as_matrix()),
        (rotations.rotate_to_body, (QUATERNIONS, VECTORS), TURNS.inv().apply(VECTORS)),
        (rotations.projected_gravity, (QUATERNIONS,), TURNS.inv().apply([0.0, 0.0, -1.0])),
        (rotations.multiply, (QUATERNIONS, QUATERNIONS[::-1]), PRODUCTS),
    ],
)
def test_a_batch_equals_scipys_in_numpy_and_in_jax(
    function: Callable, arguments: tuple[np.ndarray, ...], expected: np.ndarray
) -> None:
    np.testing.assert_allclose(function(*arguments), expected, atol=1e-12)
    np.testing.assert_allclose(function(*map(jnp.asarray, arguments)), expected, atol=1e-6)
    assert function(*(each[0].astype(np.float32) for each in arguments)).dtype == np.float32


@pytest.mark.parametrize("library", [np, jnp])
def test_tilt_and_heading_equal_scipys_also_in_batches(library) -> None:
    atol = 1e-12 if library is np else 2e-5
    upright = TURNS.apply([0.0, 0.0, 1.0])[:, 2]
    forward = TURNS.apply([1.0, 0.0, 0.0])
    heading = np.arctan2(forward[:, 1], forward[:, 0])
    batch = library.asarray(QUATERNIONS.reshape(2, 3, 4))
    np.testing.assert_allclose(rotations.tilt(batch), np.arccos(upright).reshape(2, 3), atol=atol)
    np.testing.assert_allclose(rotations.heading(batch), heading.reshape(2, 3), atol=atol)
    np.testing.assert_allclose([rotations.yaw_of(q) for q in QUATERNIONS.tolist()], heading)
    for quaternion, up in zip(QUATERNIONS, upright, strict=True):
        assert float(rotations.tilt(library.asarray(quaternion))) == pytest.approx(np.arccos(up), abs=atol)


def test_tilts_of_zero_and_half_a_turn_are_finite() -> None:
    for scale in (1.0, 1.0 + 1e-12):
        assert rotations.tilt(scale * np.array([0.0, 1.0, 0.0, 0.0])) == pytest.approx(np.pi)
        batch = scale * np.array([[0.0, 0.6, 0.8, 0.0], [1.0, 0.0, 0.0, 0.0]])
        np.testing.assert_allclose(rotations.tilt(batch), [np.pi, 0.0])


def test_roll_pitch_yaw_are_recovered_in_all_octants() -> None:
    for yaw, pitch, roll in TURNS.as_euler("ZYX"):
        turn = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
        assert rotations.roll_pitch_yaw(turn) == pytest.approx((roll, pitch, yaw))
        about_z = Rotation.from_euler("z", yaw).as_matrix()
        np.testing.assert_allclose(rotations.heading_matrix(yaw), about_z, atol=1e-12)
    beyond = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0 + 1e-12, 0.0, 0.0]])
    assert rotations.roll_pitch_yaw(beyond)[1] == pytest.approx(-np.pi / 2)
    assert rotations.roll_pitch_yaw(-beyond)[1] == pytest.approx(np.pi / 2)


@pytest.mark.parametrize("index", range(6))
def test_gravity_is_shifted_by_the_shortest_turn(index: int) -> None:
    """The body turns about an axis perpendicular to gravity, like scipy's alignment of two directions."""
    before, offset = TURNS[index], np.array([0.2, -0.1, 0.15])
    down = before.inv().apply([0.0, 0.0, -1.0])
    expected = (down + offset) / np.linalg.norm(down + offset)
    found = rotations.shift_gravity(QUATERNIONS[index].tolist(), offset.tolist())
    assert np.linalg.norm(found) == pytest.approx(1.0)
    after = Rotation.from_quat(found, scalar_first=True)
    np.testing.assert_allclose(after.inv().apply([0.0, 0.0, -1.0]), expected, atol=1e-12)
    between = np.arccos(np.clip(down @ expected, -1.0, 1.0))
    assert (before.inv() * after).magnitude() == pytest.approx(between)


def test_angles_are_wrapped_into_half_a_turn() -> None:
    for turns, angle in itertools.product((-2, -1, 0, 1, 3), (-np.pi, -3.0, -0.1, 0.0, 2.0, 3.1)):
        wrapped = rotations.wrap_angle(angle + 2 * np.pi * turns)
        assert wrapped == pytest.approx(angle, abs=1e-9) or wrapped == pytest.approx(angle + 2 * np.pi)
    assert rotations.wrap_angle(np.pi) == -np.pi


def test_a_cross_product_equals_numpys_for_any_shape() -> None:
    others = RNG.normal(size=(2, 4, 3))
    expected = np.cross(VECTORS[2], others)
    np.testing.assert_allclose(rotations.cross(VECTORS[2], others), expected, atol=1e-12)
    np.testing.assert_allclose(others @ rotations.skew(VECTORS[2]).T, expected, atol=1e-12)


def test_evenly_spaced_indices_are_read_without_a_copy() -> None:
    slices = (([3, 4, 5], slice(3, 6, 1)), ([7], slice(7, 8, 1)), ([0, 3, 6], slice(0, 7, 3)))
    for indices, expected in (*slices, ([3, 4, 6], None), ([5, 4, 3], None), ([2, 2], None)):
        found = as_slice(np.array(indices))
        np.testing.assert_array_equal(np.arange(9)[found], indices)
        assert expected is None or found == expected


@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(1, 6), st.integers(1, 3))
def test_the_solution_equals_numpys(seed: int, count: int, unknowns: int, sides: int) -> None:
    rng = np.random.default_rng(seed)
    matrices = rng.normal(size=(count, unknowns, unknowns)) + 3.0 * np.eye(unknowns)
    right = rng.normal(size=(count, unknowns, sides))
    np.testing.assert_array_equal(solve(matrices, right), np.linalg.solve(matrices, right))


def test_a_singular_matrix_gives_nan_for_itself_only() -> None:
    x = solve(np.array([np.zeros((3, 3)), 2.0 * np.eye(3)]), np.ones((2, 3, 1)))
    assert np.isnan(x[0]).all()
    np.testing.assert_array_equal(x[1], 0.5 * np.ones((3, 1)))
