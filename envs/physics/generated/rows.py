"""MuJoCo's soft constraints as rows of a Jacobian, with the parameters that the solver needs.

MuJoCo: its documentation, chapter Computation, sections Constraint model and Parameters.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.envs.physics.generated.algebra import Vector, cross
from footfall.envs.physics.generated.cone import Cone
from footfall.envs.physics.generated.contacts import Contact, LinkPose
from footfall.envs.physics.generated.expression import Scalar, absolute, less, maximum, minimum, where
from footfall.envs.physics.generated.geom_pairs import MIN_FRICTION, SLIDING, TINY, GeomPair
from footfall.envs.physics.generated.limbs import Pair, Part
from footfall.envs.physics.generated.tree import BASE_DOFS, Tree

MIN_IMPEDANCE, MAX_IMPEDANCE = 1e-4, 0.9999  # MuJoCo's mjMINIMP, mjMAXIMP

Row = dict[int, Scalar]  # of a Jacobian, by degree of freedom


class Rows(NamedTuple):
    """A contact, or a joint's limit, as the solver sees it."""

    jacobian: tuple[Row, ...]  # of the speed along the normal and along each tangent
    friction: tuple[Scalar, ...]  # along each tangent
    weight: Scalar  # D of all its rows; 0 without contact
    reference: tuple[Scalar, ...]  # minus the reference acceleration, along normal and tangents
    pair: Pair | None = None  # of a contact between two limbs: the Jacobian is this limb's part of it
    cone: Cone | None = None  # with a cone, `weight` is D of the normal's row

    def edges(self, along: list[Scalar]) -> list[Scalar]:
        """Values along the edges of the friction pyramid, if any, from values along normal and tangents."""
        if not self.friction or self.cone is not None:
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
    part: Part,
    poses: dict[int, LinkPose],
    velocity: list[Scalar],
    friction: Scalar,
    pair: Pair | None = None,
) -> Rows:
    """MuJoCo's constraint of a contact.

    Args:
        contact: the contact.
        model: nominal.
        part: the robot or the limb that the rows belong to.
        poses: poses of links.
        velocity: velocity of all degrees of freedom, the base's in its own frame.
        friction: the geoms' coefficient, used if the pair of geoms has none.
        pair: of a contact between two limbs.
    """
    geom_pair = contact.geom_pair
    signs = _signs(geom_pair, model, part, pair)
    jacobian = tuple(
        _row(contact, direction, model, part.tree, poses, signs)
        for direction in (contact.normal, *contact.tangents)
    )
    speeds = [sum((j * velocity[dof] for dof, j in row.items()), start=0.0) for row in jacobian]
    speeds = [part.of_both(speed, pair) for speed in speeds]
    depth = contact.distance - geom_pair.margin
    impedance = _impedance(absolute(depth), geom_pair.solimp)
    stiffness, damping = _spring(geom_pair.solref, geom_pair.solimp, model.opt.timestep)
    reference = [damping * speed for speed in speeds]
    reference[0] = reference[0] + stiffness * (impedance * depth)
    # Regularisation R = (1 - d) / d times the diagonal of A, which the bodies' inverse weights approximate.
    # For a pyramid, R is 2 mu^2 times R of its first row. The weight is D = 1 / R.
    inverse_weight = sum(float(model.body_invweight0[model.geom_bodyid[geom]][0]) for geom in geom_pair.geoms)
    frictions: tuple[Scalar, ...] = ()
    scale: Scalar = inverse_weight
    cone: Cone | None = None
    if geom_pair.dimensions == SLIDING:
        frictions = geom_pair.friction or (friction, friction)
    if frictions and model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC:
        cone = Cone(frictions, float(model.opt.impratio))
    elif frictions:
        square = frictions[0] * frictions[0]
        scale = inverse_weight * (1.0 + square) * (2.0 * square)
    regularisation = maximum(scale * (1.0 - impedance) / impedance, TINY)
    weight = where(less(depth, 0.0), where(less(0.0, contact.excess), 0.0, 1.0 / regularisation), 0.0)
    if pair is not None:
        weight = weight * part.number(0.0 if pair.number is None else 0.5)
    elif all(dof < BASE_DOFS for row in jacobian for dof in row):
        weight = weight * part.share
    return Rows(jacobian, frictions, weight, tuple(reference), pair, cone)


def limit_rows(
    model: mujoco.MjModel, tree: Tree, angles: Sequence[Scalar], velocity: list[Scalar]
) -> Iterator[Rows]:
    """MuJoCo's constraint of each joint with limits: a row for the nearer limit, active beyond it.

    Args:
        model: nominal, of a tree of hinges on a free base.
        tree: its tree.
        angles: angles of the hinges.
        velocity: velocity of all degrees of freedom.
    """
    for link, (hinge, angle) in enumerate(zip(tree.hinges, angles, strict=True)):
        joint, dof = hinge.joint, BASE_DOFS + link
        if not model.jnt_limited[joint]:
            continue
        lower, upper = (float(end) for end in model.jnt_range[joint])
        above, below = angle - lower, upper - angle
        sign, distance = where(less(above, below), 1.0, -1.0), minimum(above, below)
        solref, solimp = model.jnt_solref[joint].tolist(), model.jnt_solimp[joint].tolist()
        impedance = _impedance(absolute(distance), solimp)
        stiffness, damping = _spring(solref, solimp, model.opt.timestep)
        reference = damping * (sign * velocity[dof]) + stiffness * (impedance * distance)
        regularisation = maximum(float(model.dof_invweight0[hinge.dof]) * (1.0 - impedance) / impedance, TINY)
        yield Rows(({dof: sign},), (), where(less(distance, 0.0), 1.0 / regularisation, 0.0), (reference,))


def geom_friction(model: mujoco.MjModel, geoms: tuple[int, int], friction: np.ndarray) -> Scalar:
    """Sliding friction of two geoms: of the one with priority, else the larger.

    Args:
        model: nominal.
        geoms: the two geoms.
        friction: (geoms, 3), possibly randomised.
    """
    one, two = (friction[geom, 0] for geom in geoms)
    first, second = (int(model.geom_priority[geom]) for geom in geoms)
    coefficient = maximum(one, two) if first == second else (one if first > second else two)
    return maximum(coefficient, MIN_FRICTION)


def _signs(
    geom_pair: GeomPair, model: mujoco.MjModel, part: Part, pair: Pair | None
) -> list[tuple[int, Scalar]]:
    """The bodies of this part that make the contact, with the signs of their speeds in its rows."""
    geoms: tuple[int, int] = geom_pair.geoms
    signs: list[Scalar] = [-1.0, 1.0]
    if pair is not None:
        geoms, signs[1 - pair.side] = pair.own_geoms, 0.0  # the other geom belongs to the partner
        signs = [part.number(sign) for sign in signs]
    bodies = [int(model.geom_bodyid[geom]) for geom in geoms]
    return [(body, sign) for body, sign in zip(bodies, signs, strict=True) if body in part.tree.bodies]


def _row(
    contact: Contact,
    direction: Vector,
    model: mujoco.MjModel,
    tree: Tree,
    poses: dict[int, LinkPose],
    signs: list[tuple[int, Scalar]],
) -> Row:
    """Row of the relative speed along a direction: the second geom's contact point minus the first's."""
    row: Row = {}
    for body, sign in signs:
        entries: Row = {}
        if len(signs) == 1:  # the base moves both ends of a contact within the robot alike
            entries = dict(enumerate((*direction, *cross(contact.position, direction))))
        for link in tree.chain(tree.bodies[body].link):
            pose = poses[link]
            axis = pose.turn @ tree.hinges[link].axis
            entries[BASE_DOFS + link] = direction @ cross(axis, contact.position - pose.position)
        for dof, entry in entries.items():
            row[dof] = row.get(dof, 0.0) + sign * entry
    return {dof: entry for dof, entry in row.items() if not (isinstance(entry, float) and entry == 0.0)}


def _impedance(depth: Scalar, solimp: Sequence[float]) -> Scalar:
    """MuJoCo's sigmoid d(r), from d_0 at the surface to d_width; `depth` is not negative."""
    start, end = (min(max(d, MIN_IMPEDANCE), MAX_IMPEDANCE) for d in solimp[:2])
    width, middle, power = max(solimp[2], TINY), solimp[3], solimp[4]
    x = minimum(depth / width, 1.0)
    if power == 1.0:
        return start + x * (end - start)
    below, above = x * x / middle, 1.0 - (1.0 - x) * (1.0 - x) / (1.0 - middle)
    return start + where(x < middle, below, above) * (end - start)


def _spring(solref: Sequence[float], solimp: Sequence[float], timestep_s: float) -> tuple[float, float]:
    """Stiffness and damping of the reference acceleration, from solref in either of its forms."""
    first, second = solref[:2]
    width = min(max(solimp[1], MIN_IMPEDANCE), MAX_IMPEDANCE)
    if first <= 0.0:
        return -first / width**2, -second / width
    time_constant_s = max(first, 2.0 * timestep_s)  # MuJoCo's refsafe
    return 1.0 / max(TINY, (width * time_constant_s * second) ** 2), 2.0 / max(TINY, width * time_constant_s)
