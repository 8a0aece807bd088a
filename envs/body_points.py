"""Points on the trunk and the limbs, which touch the ground on a robot but not in training's physics.

Training computes contacts of the feet only. With these points, terms know where other links would touch.
"""

import itertools
from collections.abc import Iterator
from typing import NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np

from footfall.common.rotations import rotation_matrix
from footfall.envs.base import Base
from footfall.robots.description import Robot
from footfall.robots.link_tree import PRISMATIC, Link, link_tree, load_model

SPACING_M = 0.13  # between two points along a shape, at most
# Along the longest side of a shape of the base. Over stairs the base is tilted: an edge between points
# 0.13 m apart reaches 0.06 m into it unseen, and on the simulated robot any touch of the base is a fall.
BASE_SPACING_M = 0.045


class Level(NamedTuple):
    """Links at the same depth of the tree. A parent is given by its index in the level above."""

    parent: np.ndarray  # (links,)
    position: np.ndarray  # (links, 3) m, in the parent's frame
    rotation: np.ndarray  # (links, 3, 3) parent's frame from the link's, joint at zero
    turn_axis: np.ndarray  # (links, 3) axis of a revolute joint, else 0
    slide_axis: np.ndarray  # (links, 3) axis of a prismatic joint, else 0
    address: np.ndarray  # (links,) of the joint in qpos; arbitrary without a joint


class BodyPoints:
    """Points on the collision shapes of the robot, except its feet; holds constants only."""

    def __init__(self, robot: Robot) -> None:
        model = load_model(robot)
        links = [link for link in link_tree(robot, model) if link.body >= 0 or link.joint]
        self._base = Base(model, robot)
        by_depth = _by_depth(links)
        self._levels = list(_levels(model, by_depth))
        feet = {name for foot in robot.description.feet for name in foot.geoms}
        points = []
        for index, link in enumerate(itertools.chain.from_iterable(by_depth)):
            spacing_m = BASE_SPACING_M if index == 0 else SPACING_M
            of_body = _points(model, link.body, feet, spacing_m)
            points += [(index, link.body_origin + position, radius) for position, radius in of_body]
        self._link = np.array([index for index, _, _ in points], dtype=int)
        self._offset = np.array([offset for _, offset, _ in points]).reshape(-1, 3).astype(np.float32)
        self.radius = np.array([radius for _, _, radius in points], dtype=np.float32)  # (points,) m
        self.on_base = self._link == 0  # (points,) bool

    def points(self, qpos: jax.Array) -> jax.Array:
        """The points in the world, m, (points, 3), of positions qpos (nq,)."""
        positions = self._base.position(qpos)[None]
        rotations = rotation_matrix(self._base.quaternion(qpos))[None]
        all_positions, all_rotations = [positions], [rotations]
        for level in self._levels:
            parent_rotation = rotations[level.parent]
            joint = qpos[level.address]  # angles, rad, or displacements, m
            offset = level.position + jnp.einsum(
                "lij,lj->li", level.rotation, level.slide_axis * joint[:, None]
            )
            positions = positions[level.parent] + jnp.einsum("lij,lj->li", parent_rotation, offset)
            rotations = parent_rotation @ (level.rotation @ _about(level.turn_axis, joint))
            all_positions.append(positions)
            all_rotations.append(rotations)
        origin, rotation = (jnp.concatenate(each)[self._link] for each in (all_positions, all_rotations))
        return origin + jnp.einsum("pij,pj->pi", rotation, self._offset)


def _by_depth(links: list[Link]) -> list[list[Link]]:
    """The links grouped by depth in the tree, the root first."""
    levels = [links[:1]]
    while True:
        names = {link.name for link in levels[-1]}
        below = [link for link in links if link.parent in names]
        if not below:
            return levels
        levels.append(below)


def _levels(model: mujoco.MjModel, by_depth: list[list[Link]]) -> Iterator[Level]:
    for above, level in itertools.pairwise(by_depth):
        names = [link.name for link in above]
        is_prismatic = np.array([link.kind == PRISMATIC for link in level])[:, None]
        axes = np.array([link.axis for link in level], dtype=np.float32)
        joints = [model.joint(link.joint).qposadr[0] if np.any(link.axis) else 0 for link in level]
        yield Level(
            parent=np.array([names.index(link.parent) for link in level]),
            position=np.array([link.position for link in level], dtype=np.float32),
            rotation=np.array([link.rotation for link in level], dtype=np.float32),
            turn_axis=np.where(is_prismatic, 0.0, axes).astype(np.float32),
            slide_axis=np.where(is_prismatic, axes, 0.0).astype(np.float32),
            address=np.array(joints),
        )


def _about(axis: np.ndarray, angle: jax.Array) -> jax.Array:
    """Rotations (links, 3, 3) about unit axes (links, 3), by Rodrigues' formula.

    The identity for a zero axis.
    """
    x, y, z = axis.T
    zero = np.zeros_like(x)
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    sine, versine = jnp.sin(angle)[:, None, None], (1.0 - jnp.cos(angle))[:, None, None]
    return np.eye(3, dtype=np.float32) + sine * skew + versine * (skew @ skew)


def _points(
    model: mujoco.MjModel, body: int, feet: set[str], longest_side_spacing_m: float
) -> Iterator[tuple[np.ndarray, float]]:
    """Positions in the body's frame, m, and radii, m, of points on its collision shapes.

    Args:
        feet: names of the feet's geoms, which get no points.
        longest_side_spacing_m: spacing along a shape's longest side. `SPACING_M` applies to the others.
    """
    for geom in np.flatnonzero(model.geom_bodyid == body).tolist() if body >= 0 else ():
        if model.geom(geom).name in feet or not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
            continue
        half_sizes, radius = _core(model, geom)
        spacing = np.where(half_sizes < half_sizes.max(), SPACING_M, longest_side_spacing_m)
        counts = 1 + np.ceil(2.0 * half_sizes / spacing - 1e-9).astype(int)
        axes = [
            np.linspace(-half, half, count) if count > 1 else np.zeros(1)
            for half, count in zip(half_sizes, counts, strict=True)
        ]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        on_surface = np.any(np.abs(grid) > half_sizes - 1e-9, axis=1)  # true of all points of a line
        rotation = rotation_matrix(model.geom_quat[geom])
        for point in grid[on_surface]:
            yield model.geom_pos[geom] + rotation @ (model.geom_aabb[geom, :3] + point), radius


def _core(model: mujoco.MjModel, geom: int) -> tuple[np.ndarray, float]:
    """A shape as a sphere swept through a box: half sizes (3,), m, and the sphere's radius, m."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.zeros(3), float(size[0])
    if kind in (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER):
        is_capsule = kind == mujoco.mjtGeom.mjGEOM_CAPSULE
        return np.array([0.0, 0.0, size[1] if is_capsule else max(0.0, size[1] - size[0])]), float(size[0])
    return model.geom_aabb[geom, 3:].copy(), 0.0
