"""Capsule pairs through which the legs of a machine collide in training: few, because each pair costs time.

A leg's shank gets a capsule that includes the foot, or ends at the ankle if the foot is a link of its own.
Such a foot gets a second capsule. Random poses show which capsules of two legs collide.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.robots.importer.machine import Geom, Leg, Machine, pose_of
from footfall.robots.importer.model_xml import model_xml
from footfall.robots.importer.pose import Pose
from footfall.robots.importer.shapes import fit_along

POSES = 4000  # number of random poses
LOW_SHARE = 0.5  # smallest depth of both feet below the base, over the standing height
MIN_SHARE = 0.01  # smallest share of poses with two low feet in which two capsules collide
STARTS = 400  # number of random poses near the start of training
START_RAD = 0.1  # deviation of joints from the default pose at the start of training
SHANK_SHARE = 0.25  # smallest distance of the shank's joint from the foot, over the leg's length

GeomPair = tuple[str, str]


class LegPairs(NamedTuple):
    """A machine with capsules that collide only with each other."""

    machine: Machine
    pairs: tuple[GeomPair, ...]  # names of the capsules; the pair that collides most often is first


class _Capsule(NamedTuple):
    leg: int
    link: int
    geom: Geom


def with_leg_pairs(machine: Machine, pose: Pose, seed: int = 0) -> LegPairs:
    """The machine with the capsules through which its legs collide; without capsules if no legs can collide.

    Candidates collide in at least `MIN_SHARE` of the poses and never near the start of training. The most
    frequent ones are taken, at most as many as there are capsules. Mirror images count equally often.

    Args:
        machine: the robot.
        pose: the default pose.
        seed: seed of the random poses.
    """
    model = mujoco.MjModel.from_xml_string(model_xml(machine))
    data = pose_of(model, model.qpos0)
    capsules = [
        _Capsule(number, link, geom)
        for number, leg in enumerate(machine.legs)
        for link, geom in _capsules_of(leg, machine, model, data)
    ]
    candidates = [(a, b) for a, b in combinations(capsules, 2) if a.leg != b.leg]
    random = np.random.default_rng(seed)
    shares = _collision_shares(_with_capsules(machine, capsules), pose, candidates, random)
    names = [(a.geom.name, b.geom.name) for a, b in candidates]
    mirrored = _mirror_images(machine, capsules, data)
    images = {frozenset(mirrored[name] for name in pair): shares[pair] for pair in names}
    shares |= {pair: max(shares[pair], images.get(frozenset(pair), 0.0)) for pair in names if shares[pair]}
    frequent = [pair for pair in sorted(names, key=lambda pair: -shares[pair]) if shares[pair] >= MIN_SHARE]
    pairs = tuple(frequent[: len(capsules)])
    used = {name for pair in pairs for name in pair}
    return LegPairs(_with_capsules(machine, [c for c in capsules if c.geom.name in used]), pairs)


def _capsules_of(
    leg: Leg, machine: Machine, model: mujoco.MjModel, data: mujoco.MjData
) -> Iterator[tuple[int, Geom]]:
    """The capsules of a leg, each with its link's index: of the shank, and of a foot behind an ankle."""
    spheres = data.geom_xpos[[model.geom(name).id for name in leg.geoms]]
    positions = np.array([*data.xanchor[[model.joint(name).id for name in leg.joints]], spheres.mean(axis=0)])
    length = np.linalg.norm(np.diff(positions, axis=0), axis=1).sum()
    distance = np.linalg.norm(positions[:-1] - positions[-1], axis=1)
    last = int(np.flatnonzero(distance >= min(SHANK_SHARE * length, distance.max()))[-1])
    shank = next(
        index
        for index, link in enumerate(machine.links)
        if leg.joints[last] in [hinge.name for hinge in link.hinges]
    )
    parts = {shank: ("shank", positions[last + 1] - positions[last])}
    if shank != leg.link:
        _, extent, axes = np.linalg.svd(spheres - spheres.mean(axis=0))
        parts[leg.link] = ("sole", extent[0] * axes[0])
    for index, (part, along) in parts.items():
        link = machine.links[index]
        if link.geoms:
            axes = data.xmat[model.body(link.name).id].reshape(3, 3)
            shape = fit_along([geom.shape for geom in link.geoms], axes.T @ along)
            yield index, Geom(f"{leg.name}_{part}", shape, 0.0, contype=0, conaffinity=0, of_body=link.name)


def _mirror_images(machine: Machine, capsules: list[_Capsule], data: mujoco.MjData) -> dict[str, str]:
    """For each capsule, the name of the same part of the leg nearest to its mirror image."""
    hips = np.array([data.joint(leg.joints[0]).xanchor for leg in machine.legs])
    base = data.body(machine.links[0].name)
    hips = (hips - base.xpos) @ base.xmat.reshape(3, 3)
    distance = np.linalg.norm(hips[:, None] * (1.0, -1.0, 1.0) - hips, axis=2)
    nearest = distance.argmin(axis=1)
    part = {(c.leg, c.geom.name.rpartition("_")[2]): c.geom.name for c in capsules}
    return {name: part.get((int(nearest[leg]), kind), name) for (leg, kind), name in part.items()}


def _with_capsules(machine: Machine, capsules: list[_Capsule]) -> Machine:
    links = list(machine.links)
    for _, index, geom in capsules:
        links[index] = replace(links[index], geoms=(*links[index].geoms, geom))
    return replace(machine, links=tuple(links))


def _collision_shares(
    machine: Machine, pose: Pose, candidates: list[tuple[_Capsule, _Capsule]], random: np.random.Generator
) -> dict[GeomPair, float]:
    """Share of poses with low feet in which each pair collides; 0 if it collides at the start of training."""
    names = {(a.geom.name, b.geom.name): (a.leg, b.leg) for a, b in candidates}
    model = mujoco.MjModel.from_xml_string(model_xml(machine, pairs=names))
    data = mujoco.MjData(model)
    pair_of = {frozenset(model.geom(name).id for name in pair): pair for pair in names}
    for joint, angle in pose.joints.items():
        data.joint(joint).qpos[0] = angle
    of_legs = {name for leg in machine.legs for name in leg.joints}
    hinges = [hinge for hinge in machine.hinges if hinge.name in of_legs]
    at = np.array([int(model.joint(hinge.name).qposadr[0]) for hinge in hinges])
    default, low, high = data.qpos[at].copy(), [h.low for h in hinges], [h.high for h in hinges]
    feet = [[model.geom(name).id for name in leg.geoms] for leg in machine.legs]
    base = model.body(machine.links[0].name).id

    def colliding(joints: np.ndarray) -> set[GeomPair]:
        data.qpos[at] = joints
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        touching = (frozenset(geoms) for geoms in data.contact.geom.tolist())
        return {pair_of[geoms] for geoms in touching if geoms in pair_of}

    poses: Counter[GeomPair] = Counter()
    contacts: Counter[GeomPair] = Counter()
    for joints in random.uniform(low, high, (POSES, len(at))):
        found = colliding(joints)
        depth = [data.xpos[base][2] - data.geom_xpos[geoms, 2].mean() for geoms in feet]
        are_low = [each >= LOW_SHARE * pose.height_m for each in depth]
        both_low = [pair for pair, (first, second) in names.items() if are_low[first] and are_low[second]]
        poses.update(both_low)
        contacts.update(found.intersection(both_low))
    offsets = START_RAD * random.uniform(-1.0, 1.0, (STARTS, len(at)))
    at_start = set().union(*(colliding(default + offset) for offset in offsets))
    return {pair: 0.0 if pair in at_start else contacts[pair] / max(poses[pair], 1) for pair in names}
