"""Rotations that the controllers and the estimator need. Quaternions are w, x, y, z."""

import math

import numpy as np


def rotation_matrix(quaternion: np.ndarray) -> np.ndarray:
    """Rotation (3, 3) of a quaternion (4,), which need not be normalised: body to world."""
    w, x, y, z = quaternion.tolist()
    scale = 2.0 / max(w * w + x * x + y * y + z * z, 1e-12)
    xx, yy, zz = scale * x * x, scale * y * y, scale * z * z
    xy, xz, yz = scale * x * y, scale * x * z, scale * y * z
    wx, wy, wz = scale * w * x, scale * w * y, scale * w * z
    return np.array(
        [
            [1 - yy - zz, xy - wz, xz + wy],
            [xy + wz, 1 - xx - zz, yz - wx],
            [xz - wy, yz + wx, 1 - xx - yy],
        ]
    )


def roll_pitch_yaw(rotation: np.ndarray) -> tuple[float, float, float]:
    """Angles of R = Rz(yaw) Ry(pitch) Rx(roll), rad."""
    pitch = math.asin(min(1.0, max(-1.0, -rotation[2, 0])))
    roll = math.atan2(rotation[2, 1], rotation[2, 2])
    return roll, pitch, math.atan2(rotation[1, 0], rotation[0, 0])


def heading_matrix(yaw: float) -> np.ndarray:
    """Rotation (3, 3) by yaw (rad) about the vertical: heading frame to world."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def wrap_angle(angle: float) -> float:
    """The same angle in [-pi, pi), rad."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def skew(vector: np.ndarray) -> np.ndarray:
    """Matrix (3, 3) of the cross product with a vector (3,): skew(a) @ b = a x b, b @ skew(a).T for rows."""
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def cross(vector: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Cross product of one vector (3,) with others (..., 3); a fraction of `numpy.cross`'s overhead."""
    return others @ skew(vector).T
