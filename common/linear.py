"""Linear equations of a few unknowns, many at a time."""

from collections.abc import Callable

import numpy as np

_solve: Callable[[np.ndarray, np.ndarray], np.ndarray]
try:
    # What `numpy.linalg.solve` calls in the end: LAPACK's gesv on a stack of matrices. Of a stack of 3 by 3
    # its own checks take longer than the solution, and a control loop needs two in each tick.
    from numpy.linalg import _umath_linalg

    _solve = _umath_linalg.solve
except (ImportError, AttributeError):  # a NumPy that has it elsewhere
    _solve = np.linalg.solve


def solve_regular(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """As `solve`, of matrices none of which is singular: not to look out for them saves half the time."""
    return _solve(matrices, right)


@np.errstate(invalid="ignore")
def solve(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """The x (..., m, k) of matrices (..., m, m) x = right (..., m, k), all of them floats.

    Where a matrix is singular, x is not a number.
    """
    return _solve(matrices, right)
