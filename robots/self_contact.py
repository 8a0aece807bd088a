"""Self-contacts of a robot: pairs of capsules and spheres that approximate its collision shapes.

Training's physics supports contacts between capsules and spheres. Robots that lie and get up need all pairs
that their joint limits permit; a walking robot needs the pairs that its MJCF lists.
"""

import math
from collections.abc import Iterator
from itertools import combinations, product
from typing import Literal

import mujoco
import numpy as np

from footfall.common.rotations import rotation_matrix

CAPSULE, SPHERE = mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_SPHERE
SMOOTH, ROUGH = 1, 3  # condim; with friction, training of go1 on a GPU runs at 0.7 of the speed
POSES = 1000  # random poses within the joint limits
RADIUS_SHARE = 0.999  # of a capsule over the box's half width; a capsule in a cube needs a length, too
EDGE_RATIO = 20.0  # half thickness over edge radius: a thigh jams on the trunk's edge as on the true one
WORLD = 0  # body
MAX_GAP_M = 0.01  # pairs that come nearer in any random pose can touch

# Shapes that collide with the ground in training: only feet, or all shapes, which then collide with each
# other as well. With rough_limbs and true_limbs these contacts have friction. With true_limbs all geoms
# collide, otherwise those in the MJCF's pairs stand for their bodies.
Contacts = Literal["feet", "whole_body", "rough_limbs", "true_limbs"]


def add_self_contacts(spec: mujoco.MjSpec, rough: bool = False) -> None:
    """Add every pair of shapes of the robot that can touch, except those of the same or of adjacent bodies.

    Geoms in the MJCF's own pairs replace all shapes of their bodies. On other bodies, spheres and capsules
    are used directly, and any other shape is replaced by its bounding box, filled with capsules.

    Args:
        spec: MjSpec of the robot; its geoms have names.
        rough: whether there is friction between them, by MuJoCo's rule for two geoms.
    """
    listed = {frozenset((pair.geomname1, pair.geomname2)) for pair in spec.pairs}
    named = {name for pair in listed for name in pair}
    model = spec.copy().compile()
    shapes: dict[int, list[str]] = {}
    for body in spec.bodies[1:]:
        stand_ins = [geom.name for geom in body.geoms if geom.name in named]
        solid = [geom for geom in body.geoms if geom.contype or geom.conaffinity]
        of_body = stand_ins or [name for geom in solid for name in _round(body, geom, model)]
        if of_body:
            shapes[model.body(body.name).id] = of_body
    for one, other in _touching_pairs(spec.copy().compile(), shapes):
        if frozenset((one, other)) not in listed:
            spec.add_pair(name=f"{one}/{other}", geomname1=one, geomname2=other, condim=SMOOTH)
    for pair in spec.pairs if rough else ():
        pair.condim = ROUGH
        pair.friction[:2] = _friction(spec.geom(pair.geomname1), spec.geom(pair.geomname2))


def _friction(one: mujoco.MjsGeom, other: mujoco.MjsGeom) -> float:
    """Sliding friction between two geoms (MuJoCo's documentation, "Contact parameters")."""
    if one.priority != other.priority:
        return float(max(one, other, key=lambda geom: geom.priority).friction[0])
    return float(max(one.friction[0], other.friction[0]))


def _round(body: mujoco.MjsBody, geom: mujoco.MjsGeom, model: mujoco.MjModel) -> list[str]:
    """Names of spheres and capsules for a shape; new ones are added to its body."""
    if geom.type in (SPHERE, CAPSULE):
        return [geom.name]
    number = model.geom(geom.name).id
    half, axes = model.geom_aabb[number, 3:], rotation_matrix(model.geom_quat[number])
    middle_of_box = model.geom_pos[number] + axes @ model.geom_aabb[number, :3]
    thin, middle, long = (int(axis) for axis in np.argsort(half, kind="stable"))
    names: list[str] = []
    for radius, across, up in _filling(float(half[middle]), float(half[thin])):
        length = float(half[long]) - radius
        ends = [
            middle_of_box + axes[:, middle] * across + axes[:, thin] * up + axes[:, long] * end
            for end in (-length, length)
        ]
        names.append(f"{geom.name}_round_{len(names)}")
        body.add_geom(
            name=names[-1],
            type=CAPSULE,
            size=[radius, 0.0, 0.0],
            fromto=np.concatenate(ends),
            friction=geom.friction,
            priority=geom.priority,
            contype=0,
            conaffinity=0,
        )
    return names


def _filling(wide_m: float, thin_m: float) -> Iterator[tuple[float, float, float]]:
    """Circles in a rectangle of these half sizes: radius, and position along both sides, m.

    Large circles side by side, and small ones in the corners, so that edges stay sharp.
    """
    spread = wide_m - thin_m
    for offset in np.linspace(-spread, spread, 1 + math.ceil(spread / thin_m)):
        yield RADIUS_SHARE * thin_m, float(offset), 0.0
    small = thin_m / EDGE_RATIO
    for sides in product((-1.0, 1.0), repeat=2):
        yield small, sides[0] * (wide_m - small), sides[1] * (thin_m - small)


def _touching_pairs(model: mujoco.MjModel, shapes: dict[int, list[str]]) -> Iterator[tuple[str, str]]:
    excluded = excluded_bodies(model)
    pairs = [
        pair
        for one, other in combinations(sorted(shapes), 2)
        if not adjacent(model, one, other) and (one, other) not in excluded
        for pair in product(shapes[one], shapes[other])
    ]
    numbers = [tuple(model.geom(name).id for name in pair) for pair in pairs]
    data, rng, nearest = mujoco.MjData(model), np.random.default_rng(0), np.full(len(pairs), np.inf)
    hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
    limited = model.jnt_limited[hinges, None] > 0
    lower, upper = np.where(limited, model.jnt_range[hinges], [[-math.pi, math.pi]]).T
    for _ in range(POSES):
        data.qpos[model.jnt_qposadr[hinges]] = rng.uniform(lower, upper)
        mujoco.mj_kinematics(model, data)
        for index, (one, other) in enumerate(numbers):
            if nearest[index] > MAX_GAP_M:
                nearest[index] = mujoco.mj_geomDistance(model, data, one, other, 1.0, None)
    yield from (pair for pair, distance in zip(pairs, nearest, strict=True) if distance <= MAX_GAP_M)


def excluded_bodies(model: mujoco.MjModel) -> set[tuple[int, int]]:
    """Pairs of bodies, the lower number first, whose contacts the MJCF excludes."""
    return {(int(s) >> 16, int(s) & 0xFFFF) for s in model.exclude_signature}


def adjacent(model: mujoco.MjModel, one: int, other: int) -> bool:
    """MuJoCo's filter: the same body, or parent and child; the world does not count as a parent."""
    one, other = int(model.body_weldid[one]), int(model.body_weldid[other])
    parents = [int(model.body_weldid[model.body_parentid[body]]) for body in (one, other)]
    return one == other or (WORLD not in (one, other) and (other == parents[0] or one == parents[1]))
