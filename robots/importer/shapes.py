"""Fits primitive shapes, which replace meshes, to points.

The support function h(u) of a convex body is its largest extent in each direction u. For primitives of given
axes it is linear in their sizes:

    sphere   c·u + r
    capsule  c·u + r + l |a·u|
    box      c·u + Σ s_i |a_i·u|

Each fit is one linear least-squares problem over a fixed set of directions, so residuals of different shapes
can be compared.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

DIRECTIONS = 400  # number of directions in which extents are compared
MIN_HALF_THICKNESS_M = 1e-3  # smallest half-thickness of a shape
SOLE_M = 0.02  # thickness of a sole, and of the layer of points that counts as its underside
NEARLY_LEVEL = 0.05  # largest sine of the angle to the ground of an edge or face that counts as level
MIN_IMPROVEMENT = 0.9  # a less simple shape is used if its error is below this share of the simpler one's

Kind = mujoco.mjtGeom


class Shape(NamedTuple):
    """A primitive in the frame of its link."""

    kind: mujoco.mjtGeom
    size: np.ndarray  # (3,) m, as in MuJoCo
    position: np.ndarray  # (3,) m, its centre
    quaternion: np.ndarray  # (4,) w x y z


def fit_shape(points: np.ndarray) -> tuple[Shape, float]:
    """The sphere, capsule or box nearest to the hull of points (k, 3), m, and its root mean square error, m.

    Boxes enclose the points; spheres and capsules are fitted by least squares. Axes are those of the
    frame or the principal axes of the hull.
    """
    directions = _directions()
    extents = (points @ directions.T).max(axis=0)
    hull = points[(points @ directions.T).argmax(axis=0)]
    frames = (np.eye(3), _principal_axes(hull))
    fits = [_fit_sphere(directions, extents)]
    fits += [_fit_capsule(directions, extents, frame, axis) for frame in frames for axis in range(3)]
    fits += [_fit_box(directions, extents, points, frame) for frame in frames]
    best, error = fits[0]
    for shape, other_error in fits[1:]:
        if other_error < MIN_IMPROVEMENT * error:
            best, error = shape, other_error
    return best, error


def fit_along(shapes: Sequence[Shape], direction: np.ndarray) -> Shape:
    """The capsule along `direction` (3,) nearest to the hull of a link's shapes; a sphere for direction 0."""
    directions = _directions()
    extents = np.max([directions @ s.position + [support(s, u) for u in directions] for s in shapes], axis=0)
    norm = float(np.linalg.norm(direction))
    if norm > MIN_HALF_THICKNESS_M:
        _, _, rows = np.linalg.svd(direction[None] / norm)
        turned = rows[[1, 2, 0]].T
        frame = turned * np.sign(np.linalg.det(turned))
        capsule, error = _fit_capsule(directions, extents, frame, axis=2)
        if np.isfinite(error):
            return capsule
    return _fit_sphere(directions, extents)[0]


def fit_sole(points: np.ndarray, up: np.ndarray) -> Shape:
    """A flat box under points (k, 3), m: as long and as wide as the points lowest along `up` (3,)."""
    forward = np.eye(3)[np.abs(up).argmin()]
    if abs(up[0]) < 0.7:
        forward = np.array([1.0, 0.0, 0.0])
    left = np.cross(up, forward)
    left /= np.linalg.norm(left)
    axes = np.stack([np.cross(left, up), left, up], axis=1)
    local = points @ axes
    lowest = local[:, 2].min()
    bottom = local[local[:, 2] < lowest + SOLE_M]
    low, high = bottom.min(axis=0), bottom.max(axis=0)
    low[2], high[2] = lowest, lowest + SOLE_M
    return Shape(Kind.mjGEOM_BOX, _size(*(high - low) / 2), axes @ (high + low) / 2, quaternion_of(axes))


def hull_points(points: np.ndarray) -> np.ndarray:
    """The points (k, 3) that are extreme in some direction, without repetitions."""
    return points[np.unique((points @ _directions().T).argmax(axis=0))]


def quaternion_of(rotation: np.ndarray) -> np.ndarray:
    """w x y z of a rotation matrix (3, 3)."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3) of a quaternion w x y z."""
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, np.asarray(quaternion, dtype=float))
    return rotation.reshape(3, 3)


def support(shape: Shape, direction: np.ndarray) -> float:
    """Extent of a shape from its centre along a unit vector (3,) of the link's frame, m."""
    local = rotation_of(shape.quaternion).T @ direction
    size = shape.size
    match shape.kind:
        case Kind.mjGEOM_SPHERE:
            return float(size[0])
        case Kind.mjGEOM_CAPSULE:
            return float(size[0] + size[1] * abs(local[2]))
        case Kind.mjGEOM_CYLINDER:
            return float(size[0] * np.hypot(local[0], local[1]) + size[1] * abs(local[2]))
        case Kind.mjGEOM_ELLIPSOID:
            return float(np.linalg.norm(size * local))
    return float(size @ np.abs(local))


def lowest_point(shape: Shape, up: np.ndarray) -> np.ndarray:
    """The point of a shape that lies lowest along `up`, link frame, (3,) m.

    For a nearly level edge or face it is the middle. `up` is a unit vector (3,) of the same frame.
    """
    axes = rotation_of(shape.quaternion)
    local = axes.T @ up
    level = np.where(np.abs(local) < NEARLY_LEVEL, 0.0, local)
    match shape.kind:
        case Kind.mjGEOM_SPHERE:
            below = -shape.size[0] * local
        case Kind.mjGEOM_CAPSULE:
            below = -shape.size[0] * local - [0.0, 0.0, shape.size[1] * np.sign(level[2])]
        case Kind.mjGEOM_CYLINDER:
            rim = np.array([level[0], level[1], 0.0])
            below = -shape.size[0] * rim / max(np.linalg.norm(rim), 1e-9)
            below[2] = -shape.size[1] * np.sign(level[2])
        case Kind.mjGEOM_ELLIPSOID:
            below = -(shape.size**2) * local / max(np.linalg.norm(shape.size * local), 1e-9)
        case _:
            below = -shape.size * np.sign(level)
    return shape.position + axes @ below


def _directions() -> np.ndarray:
    """Directions spread evenly over the sphere (a Fibonacci lattice), (k, 3)."""
    index = np.arange(DIRECTIONS) + 0.5
    z, angle = 1 - 2 * index / DIRECTIONS, np.pi * (1 + 5**0.5) * index
    radius = np.sqrt(1 - z**2)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)


def _principal_axes(points: np.ndarray) -> np.ndarray:
    """A right-handed frame (3, 3) along the principal axes of points (k, 3), z along the longest."""
    _, _, rows = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if len(rows) < 3:
        return np.eye(3)
    return np.stack([rows[1], np.cross(rows[0], rows[1]), rows[0]], axis=1)


def _fit_sphere(directions: np.ndarray, extents: np.ndarray) -> tuple[Shape, float]:
    columns = np.column_stack([directions, np.ones(len(directions))])
    (*centre, radius), error = _least_squares(columns, extents)
    return Shape(Kind.mjGEOM_SPHERE, _size(radius), np.array(centre), np.array([1.0, 0, 0, 0])), error


def _fit_capsule(
    directions: np.ndarray, extents: np.ndarray, frame: np.ndarray, axis: int
) -> tuple[Shape, float]:
    along = np.abs(directions @ frame[:, axis])
    columns = np.column_stack([directions, np.ones(len(directions)), along])
    (*centre, radius, half), error = _least_squares(columns, extents)
    turned = np.roll(frame, 2 - axis, axis=1)  # MuJoCo's capsules lie along z
    shape = Shape(Kind.mjGEOM_CAPSULE, _size(radius, half), np.array(centre), quaternion_of(turned))
    return shape, error if radius > MIN_HALF_THICKNESS_M and half > MIN_HALF_THICKNESS_M else np.inf


def _fit_box(
    directions: np.ndarray, extents: np.ndarray, points: np.ndarray, frame: np.ndarray
) -> tuple[Shape, float]:
    low, high = (points @ frame).min(axis=0), (points @ frame).max(axis=0)
    size, centre = _size(*(high - low) / 2), frame @ ((high + low) / 2)
    box = directions @ centre + np.abs(directions @ frame) @ size
    error = float(np.sqrt(np.mean((box - extents) ** 2)))
    return Shape(Kind.mjGEOM_BOX, size, centre, quaternion_of(frame)), error


def _least_squares(columns: np.ndarray, extents: np.ndarray) -> tuple[list[float], float]:
    found = np.linalg.lstsq(columns, extents, rcond=None)[0]
    return found.tolist(), float(np.sqrt(np.mean((columns @ found - extents) ** 2)))


def _size(*values: float) -> np.ndarray:
    size = np.zeros(3)
    size[: len(values)] = np.maximum(values, MIN_HALF_THICKNESS_M)
    return size
