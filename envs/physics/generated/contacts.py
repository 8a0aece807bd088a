"""Pairs of geoms that can touch, and MuJoCo's soft contact between them as rows of constraints.

MuJoCo: its documentation, chapter Computation, sections Constraint model and Parameters.
"""

from collections.abc import Iterator
from itertools import combinations, product
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.envs.physics.generated.algebra import Matrix, Vector, cross, vector
from footfall.envs.physics.generated.expression import (
    Scalar,
    absolute,
    less,
    maximum,
    minimum,
    sqrt,
    where,
)
from footfall.envs.physics.generated.tree import Attachment, Tree, rotation
from footfall.envs.physics.interface import PLANE_NUMBERS

PLANE, SPHERE, CAPSULE, BOX = (
    mujoco.mjtGeom.mjGEOM_PLANE,
    mujoco.mjtGeom.mjGEOM_SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE,
    mujoco.mjtGeom.mjGEOM_BOX,
)
GENERATED = {(PLANE, shape) for shape in (SPHERE, CAPSULE, BOX)} | {
    (SPHERE, SPHERE),
    (SPHERE, CAPSULE),
    (CAPSULE, CAPSULE),
}
SMOOTH, SLIDING = 1, 3  # dimensions of a contact: its normal, and friction along the surface
LEAST_FRICTION = 1e-5  # MuJoCo's mjMINMU
LEAST_IMPEDANCE, MOST_IMPEDANCE = 1e-4, 0.9999  # MuJoCo's mjMINIMP, mjMAXIMP
TINY = 1e-15  # MuJoCo's mjMINVAL


class Meeting(NamedTuple):
    """Two geoms that can touch, and the parameters of their contact. The first one's type is the lower."""

    geoms: tuple[int, int]
    dimensions: int
    solref: tuple[float, ...]
    solimp: tuple[float, ...]
    margin: float  # m; a gap beyond it makes contacts without force
    friction: tuple[float, float] | None  # None: of the geoms


class Contact(NamedTuple):
    """Where two geoms are nearest, in the base's frame."""

    meeting: Meeting
    distance: Scalar  # m
    place: Vector  # (3,) m, from the base's origin
    normal: Vector  # (3,) from the first to the second
    tangents: tuple[Vector, ...]  # none of a smooth one
    excess: Scalar = 0.0  # m; above 0 there is no contact, however near the geoms are


class LinkPose(NamedTuple):
    """Where a link lies, in the base's frame."""

    turn: Matrix  # (3, 3) from the link's frame
    place: Vector  # (3,) m


def meetings(model: mujoco.MjModel) -> list[Meeting]:
    """All pairs of geoms that MuJoCo would test for contact."""
    found = [_declared(model, pair) for pair in range(model.npair)]
    known = {meeting.geoms for meeting in found}
    excluded = {(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature}
    for a, b in combinations(range(model.ngeom), 2):
        geoms = _by_type(model, a, b)
        if geoms not in known and _meet(model, a, b, excluded):
            found.append(_mixed(model, geoms))
    return found


def contact_refusals(model: mujoco.MjModel) -> Iterator[str]:
    """What of a model's contacts is not generated, one line each."""
    for meeting in meetings(model):
        names = " and ".join(repr(model.geom(g).name or f"geom {g}") for g in meeting.geoms)
        kinds = tuple(mujoco.mjtGeom(model.geom_type[g]) for g in meeting.geoms)
        if kinds not in GENERATED:
            shapes = " and ".join(kind.name[7:].lower() for kind in kinds)
            yield f"contact of {names}: {shapes}"
        elif meeting.dimensions not in {SMOOTH, SLIDING}:
            yield f"contact of {names}: condim {meeting.dimensions}"
        elif meeting.solimp[4] not in {1.0, 2.0}:
            yield f"contact of {names}: solimp's power {meeting.solimp[4]:g}"
        elif kinds[0] == PLANE and model.body_weldid[model.geom_bodyid[meeting.geoms[0]]] != 0:
            yield f"contact of {names}: a plane that moves"


def _by_type(model: mujoco.MjModel, a: int, b: int) -> tuple[int, int]:
    return (a, b) if model.geom_type[a] <= model.geom_type[b] else (b, a)


def _meet(model: mujoco.MjModel, a: int, b: int, excluded: set[tuple[int, int]]) -> bool:
    """MuJoCo's filters: contact bits, excluded pairs, bodies that are welded or parent and child."""
    bits = (model.geom_contype[a] & model.geom_conaffinity[b]) | (
        model.geom_contype[b] & model.geom_conaffinity[a]
    )
    bodies = sorted((int(model.geom_bodyid[a]), int(model.geom_bodyid[b])))
    one, two = (int(model.body_weldid[body]) for body in bodies)
    parents = [int(model.body_weldid[model.body_parentid[weld]]) for weld in (one, two)]
    related = one != 0 and two != 0 and (one == parents[1] or two == parents[0])
    return bool(bits) and one != two and not related and tuple(bodies) not in excluded


def _declared(model: mujoco.MjModel, pair: int) -> Meeting:
    geoms = _by_type(model, int(model.pair_geom1[pair]), int(model.pair_geom2[pair]))
    first, second = model.pair_friction[pair][:2].tolist()
    return Meeting(
        geoms,
        int(model.pair_dim[pair]),
        tuple(model.pair_solref[pair].tolist()),
        tuple(model.pair_solimp[pair].tolist()),
        float(model.pair_margin[pair]),
        (max(LEAST_FRICTION, first), max(LEAST_FRICTION, second)),
    )


def _mixed(model: mujoco.MjModel, geoms: tuple[int, int]) -> Meeting:
    """MuJoCo's mixing of two geoms' parameters: the one's of higher priority, else by their weights."""
    one, two = geoms
    margin = model.geom_margin[one] + model.geom_margin[two]
    priority = model.geom_priority
    if priority[one] != priority[two]:
        lead = one if priority[one] > priority[two] else two
        solref, solimp, dimensions = model.geom_solref[lead], model.geom_solimp[lead], model.geom_condim[lead]
    else:
        weights = model.geom_solmix[[one, two]]
        share = weights[0] / weights.sum() if weights.sum() >= TINY else 0.5
        first, second = model.geom_solref[one], model.geom_solref[two]
        standard = first[0] > 0.0 and second[0] > 0.0
        solref = share * first + (1.0 - share) * second if standard else np.minimum(first, second)
        solimp = share * model.geom_solimp[one] + (1.0 - share) * model.geom_solimp[two]
        dimensions = max(model.geom_condim[one], model.geom_condim[two])
    return Meeting(
        geoms, int(dimensions), tuple(solref.tolist()), tuple(solimp.tolist()), float(margin), None
    )


class Geometry:
    """The shapes of a model on its tree, and the contacts that they make."""

    def __init__(
        self,
        model: mujoco.MjModel,
        tree: Tree,
        poses: dict[int, LinkPose],
        base_turn: Matrix,
        base_place: Vector,
    ) -> None:
        """Give the poses of all links and of the base, which is the frame of all results.

        Args:
            model: nominal.
            tree: its tree.
            poses: by link; the base's is the identity.
            base_turn: (3, 3) from the base's frame to the world's.
            base_place: (3,) m, of the base in the world.
        """
        self._model, self._tree, self.poses = model, tree, poses
        self._base_turn, self._base_place = base_turn, base_place

    def centre(self, geom: int) -> Vector:
        """Of a geom, in the base's frame, m, (3,)."""
        body = self._attachment(geom)
        return self._place(body.link, body.place + body.rotation @ self._model.geom_pos[geom])

    def in_world(self, place: Vector) -> Vector:
        """A place given in the base's frame, in the world's."""
        return self._base_place + self._base_turn @ place

    def contacts(self, meeting: Meeting, ground: np.ndarray | None = None) -> list[Contact]:
        """The contacts that two geoms can make; how many does not depend on where they are.

        Args:
            meeting: of the geoms.
            ground: (4,) or (8,) numbers as of `interface.GROUND`; None: of the first geom, a plane.
        """
        one, two = meeting.geoms
        if self._model.geom_type[one] != PLANE:
            return [self._between(meeting, *self._nearest(one, two))]
        if ground is None:
            body = self._model.geom_bodyid[one]
            turn, place = self._fixed(int(body))
            normal = turn @ rotation(self._model.geom_quat[one])[:, 2]
            normal[np.abs(normal) < TINY] = 0.0
            ground = np.append(normal, normal @ (place + turn @ self._model.geom_pos[one]))
        match self._model.geom_type[two]:
            case mujoco.mjtGeom.mjGEOM_SPHERE:
                return self._on_ground(meeting, ground, two, np.zeros(3))
            case mujoco.mjtGeom.mjGEOM_CAPSULE:
                axis = self._axis(two)
                half = axis * float(self._model.geom_size[two][1])
                along = self._base_turn @ axis
                ends = (half, -half)
                return [c for end in ends for c in self._on_ground(meeting, ground, two, end, along)]
            case _:
                turn, size = self._turn(two), self._model.geom_size[two]
                corners = [turn @ (size * sign) for sign in product((-1.0, 1.0), repeat=3)]
                normal = self._base_turn.T @ ground[:3]
                return [
                    contact._replace(excess=maximum(contact.excess, normal @ corner))
                    for corner in corners  # those above the centre never touch
                    for contact in self._on_ground(meeting, ground, two, corner)
                ]

    def _on_ground(
        self, meeting: Meeting, ground: np.ndarray, geom: int, offset: Vector, along: Vector | None = None
    ) -> list[Contact]:
        """Of a ball at this offset from a geom's centre: with the plane, and with a higher level if any."""
        plane = self._on_plane(meeting, ground, geom, offset, along)
        if len(ground) == PLANE_NUMBERS:
            return [plane]
        level, beyond = self._on_level(meeting, ground, geom, offset, along)
        return [plane._replace(excess=beyond), level]

    def _on_level(
        self, meeting: Meeting, ground: np.ndarray, geom: int, offset: Vector, along: Vector | None
    ) -> tuple[Contact, Scalar]:
        """The contact of a ball with a higher level, and how far its centre is beyond the edge, m.

        With the nearest place of the level, which fills all space beyond its edge and below its height.
        """
        centre, radius = self._ball(geom, offset)
        world = self.in_world(centre)
        outwards = vector(ground[4], ground[5], 0.0)
        away = outwards @ world - ground[6]
        above = world[2] - ground[7]
        sideways, upwards = maximum(away, 0.0), maximum(above, 0.0)
        square = sideways * sideways + upwards * upwards
        length = sqrt(maximum(square, TINY))
        outside = less(TINY, square)
        through_side = less(above, away)  # which way out is shorter, of a centre inside
        side = where(outside, sideways / length, where(through_side, 1.0, 0.0))
        up = where(outside, upwards / length, where(through_side, 0.0, 1.0))
        normal = outwards * side + vector(0.0, 0.0, up)
        distance = where(outside, length, maximum(away, above)) - radius
        turned = self._base_turn.T @ normal
        place = centre - turned * (radius + 0.5 * distance)
        return Contact(meeting, distance, place, turned, self._tangents(meeting, normal, along)), -away

    def _ball(self, geom: int, offset: Vector) -> tuple[Vector, float]:
        """Centre, in the base's frame, and radius of a ball at this offset; a box's corner has no radius."""
        is_box = self._model.geom_type[geom] == BOX
        return self.centre(geom) + offset, 0.0 if is_box else float(self._model.geom_size[geom][0])

    def _on_plane(
        self, meeting: Meeting, ground: np.ndarray, geom: int, offset: Vector, along: Vector | None = None
    ) -> Contact:
        """Of a ball at this offset from a geom's centre."""
        centre, radius = self._ball(geom, offset)
        normal = self._base_turn.T @ ground[:3]
        distance = ground[:3] @ self._base_place - ground[3] + normal @ centre - radius
        place = centre - normal * (radius + 0.5 * distance)
        return Contact(meeting, distance, place, normal, self._tangents(meeting, ground[:3], along))

    def _between(self, meeting: Meeting, one: Vector, two: Vector) -> Contact:
        """Of balls around two places, the geoms' radii large."""
        radii = [float(self._model.geom_size[geom][0]) for geom in meeting.geoms]
        away = two - one
        length = sqrt(maximum(away @ away, TINY**2))
        normal, distance = away / length, length - sum(radii)
        place = one + normal * (radii[0] + 0.5 * distance)
        world = self._base_turn @ normal if meeting.dimensions > SMOOTH else normal
        return Contact(meeting, distance, place, normal, self._tangents(meeting, world, None))

    def _tangents(self, meeting: Meeting, normal: Vector, along: Vector | None) -> tuple[Vector, ...]:
        """MuJoCo's two directions along the surface, in the base's frame (mju_makeFrame).

        Given are the normal and, of a capsule on a plane, its axis, both in the world's.
        """
        if meeting.dimensions == SMOOTH:
            return ()
        across = less(absolute(normal[1]), 0.5)
        first = vector(0.0, where(across, 1.0, 0.0), where(across, 0.0, 1.0)) if along is None else along
        first = first - normal * (normal @ first)
        first = first / sqrt(maximum(first @ first, TINY))
        return self._base_turn.T @ first, self._base_turn.T @ cross(normal, first)

    def _nearest(self, one: int, two: int) -> tuple[Vector, Vector]:
        """The places nearest to each other of the axes of spheres and capsules (mjraw_CapsuleCapsule)."""
        first, second = self.centre(one), self.centre(two)
        types = self._model.geom_type
        if types[two] == SPHERE:
            return first, second
        a, b = (self._axis(geom) * float(self._model.geom_size[geom][1]) for geom in (one, two))
        aa, bb = (float(self._model.geom_size[geom][1]) ** 2 for geom in (one, two))
        between = first - second
        if types[one] == SPHERE:
            return first, second + b * ((b @ between) / bb).clip(-1.0, 1.0)
        ab, u, v = -(a @ b), -(a @ between), b @ between
        determinant = maximum(aa * bb - ab * ab, TINY)
        x, y = (bb * u - ab * v) / determinant, (aa * v - ab * u) / determinant
        for end in (1.0, -1.0):  # of the first axis: the place on the second that is nearest to it
            beyond = less(end, x) if end > 0 else less(x, end)
            y = where(beyond, (v - end * ab) / bb, y)
        x = x.clip(-1.0, 1.0)
        for end in (1.0, -1.0):
            beyond = less(end, y) if end > 0 else less(y, end)
            x = where(beyond, ((u - end * ab) / aa).clip(-1.0, 1.0), x)
        return first + a * x, second + b * y.clip(-1.0, 1.0)

    def _axis(self, geom: int) -> Vector:
        """Of a capsule, a unit vector in the base's frame."""
        return self._turn(geom)[:, 2]

    def _turn(self, geom: int) -> Matrix:
        body = self._attachment(geom)
        return self.poses[body.link].turn @ (body.rotation @ rotation(self._model.geom_quat[geom]))

    def _attachment(self, geom: int) -> Attachment:
        return self._tree.bodies[int(self._model.geom_bodyid[geom])]

    def _place(self, link: int, place: Vector) -> Vector:
        pose = self.poses[link]
        return pose.place + pose.turn @ place

    def _fixed(self, body: int) -> tuple[np.ndarray, np.ndarray]:
        """Where a body that is fixed to the world lies in it."""
        turn, place = np.eye(3), np.zeros(3)
        while body != 0:
            own = rotation(self._model.body_quat[body])
            turn, place = own @ turn, self._model.body_pos[body] + own @ place
            body = int(self._model.body_parentid[body])
        return turn, place


Row = dict[int, Scalar]  # of a Jacobian, by degree of freedom


class ContactRows(NamedTuple):
    """A contact as the solver sees it."""

    jacobian: tuple[Row, ...]  # of the speed along the normal and along each tangent
    friction: tuple[Scalar, ...]  # along each tangent
    weight: Scalar  # D of all its rows; 0 where it does not touch
    reference: tuple[Scalar, ...]  # minus the reference acceleration, along normal and tangents

    def edges(self, along: list[Scalar]) -> list[Scalar]:
        """What has these values along normal and tangents, along the edges of the friction pyramid."""
        if not self.friction:
            return along
        normal, *rest = along
        return [
            normal + sign * f * value
            for f, value in zip(self.friction, rest, strict=True)
            for sign in (1.0, -1.0)
        ]


def contact_rows(
    contact: Contact,
    model: mujoco.MjModel,
    tree: Tree,
    poses: dict[int, LinkPose],
    velocity: list[Scalar],
    friction: Scalar,
) -> ContactRows:
    """MuJoCo's constraint of a contact.

    Args:
        contact: where.
        model: nominal.
        tree: its tree.
        poses: of links.
        velocity: of all degrees of freedom, the base's in its own frame.
        friction: coefficient of the geoms, where the meeting gives none.
    """
    meeting = contact.meeting
    jacobian = tuple(
        _row(contact, direction, model, tree, poses) for direction in (contact.normal, *contact.tangents)
    )
    speeds = [sum((j * velocity[dof] for dof, j in row.items()), start=0.0) for row in jacobian]
    depth = contact.distance - meeting.margin
    impedance = _impedance(absolute(depth), meeting.solimp)
    stiffness, damping = _spring(meeting, model.opt.timestep)
    reference = [damping * speed for speed in speeds]
    reference[0] = reference[0] + stiffness * (impedance * depth)
    # Regularisation R = (1 - d) / d times the diagonal of A, estimated from the bodies' inverse weights; of
    # a pyramid 2 mu^2 times that of its first row, and its weight D = 1 / R.
    inverse_weight = sum(float(model.body_invweight0[model.geom_bodyid[geom]][0]) for geom in meeting.geoms)
    frictions: tuple[Scalar, ...] = ()
    scale: Scalar = inverse_weight
    if meeting.dimensions == SLIDING:
        frictions = meeting.friction or (friction, friction)
        square = frictions[0] * frictions[0]
        scale = inverse_weight * (1.0 + square) * (2.0 * square)
    resistance = maximum(scale * (1.0 - impedance) / impedance, TINY)
    weight = where(less(depth, 0.0), where(less(0.0, contact.excess), 0.0, 1.0 / resistance), 0.0)
    return ContactRows(jacobian, frictions, weight, tuple(reference))


def geom_friction(model: mujoco.MjModel, geoms: tuple[int, int], friction: np.ndarray) -> Scalar:
    """Sliding friction of two geoms: of the one with priority, else the larger.

    Args:
        model: nominal.
        geoms: which.
        friction: (geoms, 3), perhaps of a robot of its own.
    """
    one, two = (friction[geom, 0] for geom in geoms)
    first, second = (int(model.geom_priority[geom]) for geom in geoms)
    chosen = maximum(one, two) if first == second else (one if first > second else two)
    return maximum(chosen, LEAST_FRICTION)


def _row(
    contact: Contact, direction: Vector, model: mujoco.MjModel, tree: Tree, poses: dict[int, LinkPose]
) -> Row:
    """The speed along a direction of the second geom's place of contact less the first one's."""
    row: Row = {}
    for geom, sign in zip(contact.meeting.geoms, (-1.0, 1.0), strict=True):
        body = int(model.geom_bodyid[geom])
        if body not in tree.bodies:  # fixed to the world
            continue
        parts: Row = dict(enumerate((*direction, *cross(contact.place, direction))))
        for link in tree.chain(tree.bodies[body].link):
            pose = poses[link]
            axis = pose.turn @ tree.hinges[link].axis
            parts[6 + link] = direction @ cross(axis, contact.place - pose.place)
        for dof, part in parts.items():
            row[dof] = row.get(dof, 0.0) + sign * part
    return {dof: part for dof, part in row.items() if not (isinstance(part, float) and part == 0.0)}


def _impedance(depth: Scalar, solimp: tuple[float, ...]) -> Scalar:
    """MuJoCo's sigmoid d(r) from d_0 at the surface to d_width, of a depth without its sign."""
    start, end = (min(max(d, LEAST_IMPEDANCE), MOST_IMPEDANCE) for d in solimp[:2])
    width, middle, power = max(solimp[2], TINY), solimp[3], solimp[4]
    x = minimum(depth / width, 1.0)
    if power == 1.0:
        return start + x * (end - start)
    below, above = x * x / middle, 1.0 - (1.0 - x) * (1.0 - x) / (1.0 - middle)
    return start + where(x < middle, below, above) * (end - start)


def _spring(meeting: Meeting, timestep_s: float) -> tuple[float, float]:
    """Stiffness and damping of the reference acceleration, from solref in either of its forms."""
    first, second = meeting.solref[:2]
    width = min(max(meeting.solimp[1], LEAST_IMPEDANCE), MOST_IMPEDANCE)
    if first <= 0.0:
        return -first / width**2, -second / width
    constant = max(first, 2.0 * timestep_s)  # MuJoCo's refsafe
    return 1.0 / max(TINY, (width * constant * second) ** 2), 2.0 / max(TINY, width * constant)
