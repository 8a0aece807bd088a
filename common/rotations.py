"""Rotations for NumPy and JAX arrays.

Quaternions are w, x, y, z, of unit length, and rotate body vectors to world vectors. Angles are in rad.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from footfall.common.arrays import library

Array = Any  # a NumPy or a JAX array


def rotation_matrix(quaternion: Array) -> Array:
    """Rotation (..., 3, 3) of a unit quaternion (..., 4): body to world."""
    rows = rotation_rows(_components(quaternion))
    if isinstance(quaternion, np.ndarray) and quaternion.ndim == 1:
        return np.array([*rows[0], *rows[1], *rows[2]], quaternion.dtype).reshape(3, 3)  # faster than nested
    xp = quaternion.__array_namespace__()
    matrix = xp.asarray(rows, dtype=quaternion.dtype)
    return matrix if quaternion.ndim == 1 else xp.moveaxis(matrix, (0, 1), (-2, -1))


def rotation_rows(quaternion: Sequence[Any]) -> list[list[Any]]:
    """Rows of the rotation of a unit quaternion, both in components: plain numbers, or arrays."""
    w, x, y, z = quaternion
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]


def rotate_to_body(quaternion: Array, vector: Array) -> Array:
    """A world vector (..., 3) in the frame of a body with this unit quaternion (..., 4)."""
    return (vector[..., None, :] @ rotation_matrix(quaternion))[..., 0, :]


def projected_gravity(quaternion: Array) -> Array:
    """Direction of gravity in the body frame, a unit vector (..., 3); (0, 0, -1) when upright."""
    return _stacked(quaternion, _gravity(_components(quaternion)))


def vertical_in_body(quaternion: np.ndarray) -> tuple[float, float, float]:
    """The world's z axis in the frame of a body with one unit quaternion (4,), in plain numbers.

    The last row of `rotation_matrix`: a control loop needs it more often than the whole matrix.
    """
    x, y, z = _gravity(quaternion.tolist())
    return -x, -y, -z


def multiply(a: Array, b: Array) -> Array:
    """Product of two quaternions (..., 4): the rotation b, then a."""
    return _stacked(a, quaternion_product(_components(a), _components(b)))


def normalised(vector: Array) -> Array:
    """The vector or quaternion (..., k) at unit length; it must not be zero."""
    xp = vector.__array_namespace__()
    return vector / xp.sqrt(xp.sum(vector * vector, axis=-1, keepdims=True))


def random_rotation(u: Array) -> Array:
    """A uniformly random rotation, w x y z, from uniform numbers (3,): Shoemake, Graphics Gems III."""
    xp = u.__array_namespace__()
    low, high, turn, other = xp.sqrt(1 - u[0]), xp.sqrt(u[0]), 2 * np.pi * u[1], 2 * np.pi * u[2]
    return xp.stack([high * xp.cos(other), low * xp.sin(turn), low * xp.cos(turn), high * xp.sin(other)])


def turn_down(vector: Array) -> Array:
    """The smallest rotation that makes a vector (3,) point down, w x y z; the vector must not point up."""
    xp = vector.__array_namespace__()
    x, y, z = normalised(vector)
    return normalised(xp.stack([1.0 - z, -y, x, xp.zeros_like(z)]))


def tilt(quaternion: Array) -> Array:
    """Angle between the body's z axis and the vertical, (...). A sequence of four floats is accepted too."""
    _, x, y, _ = _components(quaternion)
    cosine = 1 - 2 * (x * x + y * y)
    if isinstance(cosine, float):
        return math.acos(max(-1.0, min(1.0, cosine)))
    xp = quaternion.__array_namespace__()
    return xp.acos(xp.clip(cosine, -1.0, 1.0))


def shift_gravity(quaternion: Sequence[float], offset: Sequence[float]) -> list[float]:
    """The nearest quaternion whose projected gravity is shifted by an offset and normalised.

    The projected gravity g becomes h, parallel to g + offset. The shortest rotation from h to g, applied
    first, does that and keeps the heading. Computed in Python floats for speed: the simulated sensors call
    it at every tick.
    """
    g = _gravity(quaternion)
    h = _unit([a + b for a, b in zip(g, offset, strict=True)])
    turn = [
        1.0 + h[0] * g[0] + h[1] * g[1] + h[2] * g[2],
        h[1] * g[2] - h[2] * g[1],
        h[2] * g[0] - h[0] * g[2],
        h[0] * g[1] - h[1] * g[0],
    ]
    return quaternion_product(quaternion, _unit(turn))


def heading(quaternion: Array) -> Array:
    """Yaw of the body's x axis, shape (...)."""
    xp = quaternion.__array_namespace__()
    w, x, y, z = (quaternion[..., k] for k in range(4))
    return xp.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def yaw_of(quaternion: Sequence[float]) -> float:
    """`heading` of one quaternion, in Python floats for speed."""
    w, x, y, z = quaternion
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def roll_pitch_yaw(rotation: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation matrix (3, 3), R = Rz(yaw) Ry(pitch) Rx(roll)."""
    (forward_x, _, _), (forward_y, _, _), (forward_z, left_z, up_z) = rotation.tolist()
    pitch = math.asin(min(1.0, max(-1.0, -forward_z)))
    return math.atan2(left_z, up_z), pitch, math.atan2(forward_y, forward_x)


def heading_matrix(yaw: float) -> np.ndarray:
    """Rotation (3, 3) by yaw about the vertical: heading frame to world."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def wrap_angle(angle: float) -> float:
    """The same angle in [-pi, pi)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def skew(vector: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) of the cross product with a vector (3,): skew(a) @ b = a x b, b @ skew(a).T for rows."""
    return vector.dot(_CROSS).reshape(3, 3)


def skews(vectors: np.ndarray) -> np.ndarray:
    """The matrices (k, 3, 3) of the cross products with vectors (k, 3)."""
    return vectors.dot(_CROSS).reshape(-1, 3, 3)


def cross(vector: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Cross product of one vector (3,) with others (..., 3); a fraction of `numpy.cross`'s overhead."""
    return others.dot(skew(vector).T)


_CROSS = np.array(  # (3, 9): the matrix of each axis, row by row
    [[0, 0, 0, 0, 0, -1, 0, 1, 0], [0, 0, 1, 0, 0, 0, -1, 0, 0], [0, -1, 0, 1, 0, 0, 0, 0, 0]], dtype=float
)


def _gravity(quaternion: Sequence[Any]) -> list[Any]:
    """Projected gravity, from and in components."""
    w, x, y, z = quaternion
    return [-2 * (x * z - w * y), -2 * (y * z + w * x), 2 * (x * x + y * y) - 1]


def quaternion_product(a: Sequence[Any], b: Sequence[Any]) -> list[Any]:
    """Product of two quaternions, both in components: plain numbers, or arrays."""
    (aw, ax, ay, az), (bw, bx, by, bz) = a, b
    return [
        aw * bw - (ax * bx + ay * by + az * bz),
        aw * bx + bw * ax + (ay * bz - az * by),
        aw * by + bw * ay + (az * bx - ax * bz),
        aw * bz + bw * az + (ax * by - ay * bx),
    ]


def _unit(vector: list[float]) -> list[float]:
    norm = math.sqrt(sum(value * value for value in vector))
    return [value / norm for value in vector]


def _components(vector: Array) -> Sequence[Any]:
    """The components of vectors (..., k), each of shape (...).

    For a single NumPy vector they are Python floats: arithmetic with these takes a tenth of the time, and
    a control loop rotates one vector at a time.
    """
    if isinstance(vector, np.ndarray) and vector.ndim == 1:
        return vector.tolist()
    if isinstance(vector, (tuple, list)):
        return vector
    return [vector[..., k] for k in range(vector.shape[-1])]


def _stacked(like: Array, components: list[Any]) -> Array:
    """Vectors (..., k) from their components, with the library and dtype of `like`."""
    xp = library(like)
    vectors = xp.asarray(components, dtype=like.dtype)
    return vectors if vectors.ndim == 1 else xp.moveaxis(vectors, 0, -1)
