"""Indices that NumPy reads without a copy."""

import numpy as np

from footfall.common.arrays import as_slice


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
