"""Vectors of three, rotations and sparse symmetric matrices of expressions."""

from collections.abc import Callable

import numpy as np

from footfall.envs.physics.generated.expression import Scalar

Vector = np.ndarray  # (3,) of expressions or numbers
Matrix = np.ndarray  # (3, 3)
Total = Callable[[Scalar], Scalar]  # the sum of a value over all limbs
Symmetric = dict[tuple[int, int], Scalar]  # entries of the lower triangle, row >= column; absent: 0


def vector(*elements: Scalar) -> np.ndarray:
    """An array of these expressions and numbers."""
    array = np.empty(len(elements), object)
    array[:] = elements
    return array


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product."""
    return vector(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def mirrored(matrix: Matrix) -> Matrix:
    """A symmetric matrix with the entries below its diagonal copied above it."""
    lower = np.tril(np.ones((3, 3), dtype=bool))
    return np.where(lower, matrix, matrix.T)


def rotation_matrix(quaternion: np.ndarray) -> Matrix:
    """From the body to the world, of a unit quaternion w x y z (RBDA, equation 4.12, transposed)."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ],
        dtype=object,
    )


def turned_about(axis: np.ndarray, sine: Scalar, cosine: Scalar) -> Matrix:
    """The rotation about a constant unit axis (Rodrigues): 1 in the axis, cosine and sine across it."""
    along = np.outer(axis, axis)
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return along + (np.eye(3) - along) * cosine + across * sine


def identity(value: Scalar) -> Scalar:
    """The sum over a single part."""
    return value


class Factor:
    """The factors of a symmetric positive matrix, H = L^T D L (RBDA, section 6.5 and table 6.3).

    Rows are eliminated from the last one on, leaves of the tree before their parents: so the mass matrix
    stays as sparse as it is, and a contact between two limbs fills in only what both of them reach.
    """

    def __init__(self, matrix: Symmetric, size: int, shared: int = 0, total: Total = identity) -> None:
        """Factorise a matrix.

        Args:
            matrix: its entries; those among the first `shared` coordinates are one limb's part of a sum.
            size: number of coordinates.
            shared: number of coordinates that all limbs share.
            total: sums a value over all limbs.
        """
        remaining, self._shared, self._total = dict(matrix), shared, total
        self._rows: list[list[tuple[int, Scalar]]] = []  # of L, below the diagonal, last row first
        self._inverse: list[Scalar] = []  # inverse of D's diagonal, last first
        for k in reversed(range(size)):
            if k == shared - 1:
                remaining = {(i, j): total(value) for (i, j), value in remaining.items() if i < shared}
            inverse = 1.0 / remaining[k, k]
            columns = [j for j in reversed(range(k)) if _is_nonzero(remaining, k, j)]
            scaled = [(i, remaining[k, i] * inverse) for i in columns]
            for i, factor in scaled:
                for j in columns:
                    if j <= i:
                        remaining[i, j] = remaining.get((i, j), 0.0) - factor * remaining[k, j]
            self._rows.append(scaled)
            self._inverse.append(inverse)

    def solve(self, rhs: list[Scalar]) -> list[Scalar]:
        """The x of H x = rhs (RBDA, table 6.4 and section 6.5).

        Like the matrix's, the shared rows of `rhs` are one limb's part of a sum.
        """
        x, last_row = list(rhs), len(rhs) - 1
        for n, row in enumerate(self._rows):
            if last_row - n == self._shared - 1:
                x[: self._shared] = map(self._total, x[: self._shared])
            for i, factor in row:
                x[i] = x[i] - factor * x[last_row - n]
        x = [value * inverse for value, inverse in zip(x, reversed(self._inverse), strict=True)]
        for n, row in reversed(list(enumerate(self._rows))):
            for i, factor in row:
                x[last_row - n] = x[last_row - n] - factor * x[i]
        return x


def _is_nonzero(matrix: Symmetric, row: int, column: int) -> bool:
    value = matrix.get((row, column), 0.0)
    return not (isinstance(value, float) and value == 0.0)


def product(matrix: Symmetric, x: list[Scalar]) -> list[Scalar]:
    """The matrix times a vector."""
    result: list[Scalar] = [0.0] * len(x)
    for (i, j), value in matrix.items():
        result[i] = result[i] + value * x[j]
        if i != j:
            result[j] = result[j] + value * x[i]
    return result


def dot(a: list[Scalar], b: list[Scalar]) -> Scalar:
    """The scalar product of two lists."""
    return sum((x * y for x, y in zip(a, b, strict=True)), start=0.0)
