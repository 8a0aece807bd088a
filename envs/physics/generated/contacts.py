"""Where geoms are nearest to each other and to the ground, in the base's frame."""

from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.envs.physics.generated.algebra import Matrix, Vector, cross, vector
from footfall.envs.physics.generated.expression import Scalar, absolute, less, maximum, sqrt, where
from footfall.envs.physics.generated.geom_pairs import BOX, PLANE, SMOOTH, SPHERE, TINY, GeomPair
from footfall.envs.physics.generated.limbs import Pair, Part
from footfall.envs.physics.generated.tree import Attachment, Tree, rotation
from footfall.envs.physics.interface import PLANE_NUMBERS


class Contact(NamedTuple):
    """Where two geoms are nearest, in the base's frame."""

    geom_pair: GeomPair
    distance: Scalar  # m
    position: Vector  # (3,) m, from the base's origin
    normal: Vector  # (3,) from the first to the second
    tangents: tuple[Vector, ...]  # empty without friction
    excess: Scalar = 0.0  # m; above 0 there is no contact, however near the geoms are


class LinkPose(NamedTuple):
    """Where a link lies, in the base's frame."""

    turn: Matrix  # (3, 3) from the link's frame
    position: Vector  # (3,) m


class Geometry:
    """The shapes of a model on its tree, and the contacts that they make."""

    def __init__(
        self,
        model: mujoco.MjModel,
        tree: Tree,
        poses: dict[int, LinkPose],
        base_turn: Matrix,
        base_position: Vector,
    ) -> None:
        """All results are in the base's frame.

        Args:
            model: the nominal model.
            tree: the model's tree of links.
            poses: pose of each link; that of the base is the identity.
            base_turn: (3, 3) from the base's frame to the world's.
            base_position: (3,) m, of the base in the world.
        """
        self._model, self._tree, self.poses = model, tree, poses
        self._base_turn, self._base_position = base_turn, base_position

    def centre(self, geom: int) -> Vector:
        """Centre of a geom, in the base's frame, m, (3,)."""
        body = self._attachment(geom)
        return self._in_base_frame(body.link, body.position + body.rotation @ self._model.geom_pos[geom])

    def in_world(self, position: Vector) -> Vector:
        """The world position of a point in the base's frame, m, (3,)."""
        return self._base_position + self._base_turn @ position

    def contacts(self, geom_pair: GeomPair, ground: np.ndarray | None = None) -> list[Contact]:
        """The contacts that two geoms can make; their number does not depend on the pose.

        Args:
            geom_pair: the two geoms.
            ground: a row of `interface.GROUND`, (4,) or (8,); None: the plane of the first geom.
        """
        one, two = geom_pair.geoms
        if self._model.geom_type[one] != PLANE:
            return [
                self._between(
                    geom_pair,
                    *self._nearest(geom_pair.geoms, lambda function, k: function(geom_pair.geoms[k])),
                )
            ]
        if ground is None:
            body = self._model.geom_bodyid[one]
            turn, position = self._fixed_pose(int(body))
            normal = turn @ rotation(self._model.geom_quat[one])[:, 2]
            normal[np.abs(normal) < TINY] = 0.0
            ground = np.append(normal, normal @ (position + turn @ self._model.geom_pos[one]))
        match self._model.geom_type[two]:
            case mujoco.mjtGeom.mjGEOM_SPHERE:
                return self._on_ground(geom_pair, ground, two, np.zeros(3))
            case mujoco.mjtGeom.mjGEOM_CAPSULE:
                axis = self._axis(two)
                half = axis * float(self._model.geom_size[two][1])
                along = self._base_turn @ axis
                ends = (half, -half)
                return [c for end in ends for c in self._on_ground(geom_pair, ground, two, end, along)]
            case _:
                turn, size = self._turn(two), self._model.geom_size[two]
                corners = [turn @ (size * sign) for sign in product((-1.0, 1.0), repeat=3)]
                normal = self._base_turn.T @ ground[:3]
                return [
                    contact._replace(excess=maximum(contact.excess, normal @ corner))
                    for corner in corners  # a corner above the box's centre never touches
                    for contact in self._on_ground(geom_pair, ground, two, corner)
                ]

    def between_limbs(self, pair: Pair, part: Part) -> Contact:
        """The contact of a limb with another one. Both limbs compute it, from the same poses."""

        def evaluate(function: Callable[[int], Vector], k: int) -> Vector:
            own_value, is_own = function(pair.own_geoms[k]), less(0.5, part.number(float(k == pair.side)))
            return vector(*(where(is_own, x, part.partner(x, pair.slot)) for x in own_value))

        return self._between(pair.geom_pair, *self._nearest(pair.geom_pair.geoms, evaluate))

    def _on_ground(
        self, geom_pair: GeomPair, ground: np.ndarray, geom: int, offset: Vector, along: Vector | None = None
    ) -> list[Contact]:
        """Contacts of a sphere at this offset from a geom's centre with the plane and with a step up."""
        plane = self._on_plane(geom_pair, ground, geom, offset, along)
        if len(ground) == PLANE_NUMBERS:
            return [plane]
        step, excess = self._on_step(geom_pair, ground, geom, offset, along)
        return [plane._replace(excess=excess), step]

    def _on_step(
        self, geom_pair: GeomPair, ground: np.ndarray, geom: int, offset: Vector, along: Vector | None
    ) -> tuple[Contact, Scalar]:
        """The contact of a sphere with a step up, and how far its centre is behind the step's face, m.

        The step fills all space behind its face and below its height.
        """
        centre, radius = self._sphere(geom, offset)
        world = self.in_world(centre)
        outwards = vector(ground[4], ground[5], 0.0)
        from_face = outwards @ world - ground[6]
        above = world[2] - ground[7]
        sideways, upwards = maximum(from_face, 0.0), maximum(above, 0.0)
        square = sideways * sideways + upwards * upwards
        length = sqrt(maximum(square, TINY))
        outside = less(TINY, square)
        through_side = less(above, from_face)  # the shorter way out, for a centre inside
        side = where(outside, sideways / length, where(through_side, 1.0, 0.0))
        up = where(outside, upwards / length, where(through_side, 0.0, 1.0))
        normal = outwards * side + vector(0.0, 0.0, up)
        distance = where(outside, length, maximum(from_face, above)) - radius
        normal_in_base = self._base_turn.T @ normal
        position = centre - normal_in_base * (radius + 0.5 * distance)
        return Contact(
            geom_pair, distance, position, normal_in_base, self._tangents(geom_pair, normal, along)
        ), -from_face

    def _sphere(self, geom: int, offset: Vector) -> tuple[Vector, float]:
        """Centre, in the base's frame, and radius of a sphere at this offset; 0 for a box's corner."""
        is_box = self._model.geom_type[geom] == BOX
        return self.centre(geom) + offset, 0.0 if is_box else float(self._model.geom_size[geom][0])

    def _on_plane(
        self, geom_pair: GeomPair, ground: np.ndarray, geom: int, offset: Vector, along: Vector | None = None
    ) -> Contact:
        """The plane's contact with a sphere at this offset from a geom's centre."""
        centre, radius = self._sphere(geom, offset)
        normal = self._base_turn.T @ ground[:3]
        distance = ground[:3] @ self._base_position - ground[3] + normal @ centre - radius
        position = centre - normal * (radius + 0.5 * distance)
        return Contact(geom_pair, distance, position, normal, self._tangents(geom_pair, ground[:3], along))

    def _between(self, geom_pair: GeomPair, one: Vector, two: Vector) -> Contact:
        """The contact of two spheres around these points, with the geoms' radii."""
        radii = [float(self._model.geom_size[geom][0]) for geom in geom_pair.geoms]
        separation = two - one
        length = sqrt(maximum(separation @ separation, TINY**2))
        normal, distance = separation / length, length - sum(radii)
        position = one + normal * (radii[0] + 0.5 * distance)
        world = self._base_turn @ normal if geom_pair.dimensions > SMOOTH else normal
        return Contact(geom_pair, distance, position, normal, self._tangents(geom_pair, world, None))

    def _tangents(self, geom_pair: GeomPair, normal: Vector, along: Vector | None) -> tuple[Vector, ...]:
        """MuJoCo's two directions along the surface, in the base's frame (mju_makeFrame).

        `normal` is in the world frame, and so is `along`, the axis of a capsule on a plane.
        """
        if geom_pair.dimensions == SMOOTH:
            return ()
        use_y = less(absolute(normal[1]), 0.5)  # the normal is far from the world's y axis
        first = vector(0.0, where(use_y, 1.0, 0.0), where(use_y, 0.0, 1.0)) if along is None else along
        first = first - normal * (normal @ first)
        first = first / sqrt(maximum(first @ first, TINY))
        return self._base_turn.T @ first, self._base_turn.T @ cross(normal, first)

    def _nearest(
        self, geoms: tuple[int, int], evaluate: Callable[[Callable[[int], Vector], int], Vector]
    ) -> tuple[Vector, Vector]:
        """The closest points on the axes of two spheres or capsules (mjraw_CapsuleCapsule).

        Args:
            geoms: the two geoms.
            evaluate: calls a function with the first (0) or the second geom (1).
        """
        one, two = geoms
        first, second = evaluate(self.centre, 0), evaluate(self.centre, 1)
        types = self._model.geom_type
        if types[two] == SPHERE:
            return first, second
        a, b = (
            evaluate(self._axis, k) * float(self._model.geom_size[geom][1]) for k, geom in enumerate(geoms)
        )
        aa, bb = (float(self._model.geom_size[geom][1]) ** 2 for geom in (one, two))
        offset = first - second
        if types[one] == SPHERE:
            return first, second + b * ((b @ offset) / bb).clip(-1.0, 1.0)
        ab, u, v = -(a @ b), -(a @ offset), b @ offset
        determinant = maximum(aa * bb - ab * ab, TINY)
        x, y = (bb * u - ab * v) / determinant, (aa * v - ab * u) / determinant
        # Clamp to an end of the first axis, then find the nearest point on the second.
        for end in (1.0, -1.0):
            beyond = less(end, x) if end > 0 else less(x, end)
            y = where(beyond, (v - end * ab) / bb, y)
        x = x.clip(-1.0, 1.0)
        for end in (1.0, -1.0):
            beyond = less(end, y) if end > 0 else less(y, end)
            x = where(beyond, ((u - end * ab) / aa).clip(-1.0, 1.0), x)
        return first + a * x, second + b * y.clip(-1.0, 1.0)

    def _axis(self, geom: int) -> Vector:
        """Axis of a capsule, a unit vector in the base's frame."""
        return self._turn(geom)[:, 2]

    def _turn(self, geom: int) -> Matrix:
        body = self._attachment(geom)
        return self.poses[body.link].turn @ (body.rotation @ rotation(self._model.geom_quat[geom]))

    def _attachment(self, geom: int) -> Attachment:
        return self._tree.bodies[int(self._model.geom_bodyid[geom])]

    def _in_base_frame(self, link: int, position: Vector) -> Vector:
        pose = self.poses[link]
        return pose.position + pose.turn @ position

    def _fixed_pose(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        """Rotation and position in the world of a body that is fixed to it."""
        turn, position = np.eye(3), np.zeros(3)
        while body != 0:
            body_turn = rotation(self._model.body_quat[body])
            turn, position = body_turn @ turn, self._model.body_pos[body] + body_turn @ position
            body = int(self._model.body_parentid[body])
        return turn, position
