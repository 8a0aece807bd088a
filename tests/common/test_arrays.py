"""Indices that NumPy reads without a copy, and linear equations, many at a time."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from footfall.common.arrays import as_slice
from footfall.common.linear import solve


def test_evenly_spaced_indices_are_read_without_a_copy() -> None:
    for indices, expected in (
        ([3, 4, 5], slice(3, 6, 1)),
        ([7], slice(7, 8, 1)),
        ([0, 3, 6], slice(0, 7, 3)),
        ([3, 4, 6], None),
        ([5, 4, 3], None),
        ([2, 2], None),
    ):
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
