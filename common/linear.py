"""Small linear systems, many at a time."""

from collections.abc import Callable

import numpy as np

_solve: Callable[[np.ndarray, np.ndarray], np.ndarray]
try:
    # `numpy.linalg.solve` calls this: LAPACK's gesv on a stack of matrices. For 3 by 3 matrices its checks
    # take longer than the solution, and a control loop solves two systems in each tick.
    from numpy.linalg import _umath_linalg

    _solve = _umath_linalg.solve
except (ImportError, AttributeError):  # another NumPy version
    _solve = np.linalg.solve


def solve_regular(matrices: np.ndarray, right_side: np.ndarray) -> np.ndarray:
    """As `solve`, for matrices that are not singular: without the check, a solution takes half the time."""
    return _solve(matrices, right_side)


@np.errstate(invalid="ignore")
def solve(matrices: np.ndarray, right_side: np.ndarray) -> np.ndarray:
    """The x (..., m, k) of matrices (..., m, m) x = right (..., m, k), all of them floats.

    If a matrix is singular, its x is NaN.
    """
    return _solve(matrices, right_side)
