"""Finds the legs of a model: the chains of joints from the base to the feet."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.importer.machine import frozen_pose, geom_shape, pose_of
from footfall.robots.importer.shapes import lowest_point
from footfall.robots.importer.source import Source

FOOT_NAME = re.compile(r"foot|feet|sole|paw|(^|[^a-z])toes?([^a-z]|$)", re.IGNORECASE)
NO_FOOT_NAME = re.compile(r"gripper|hand|finger|thumb|palm|wrist|wheel", re.IGNORECASE)
MIN_DEPTH_SHARE = 0.7  # smallest depth of a foot, over that of the deepest limb
MIN_FEET = 2


class Limb(NamedTuple):
    """A chain of joints that ends in a foot."""

    joints: tuple[str, ...]  # from the base outwards; those near the base may be shared with other limbs
    bodies: tuple[int, ...]  # bodies that move together at its end
    foot_bodies: frozenset[str]  # bodies that are named as feet, if any


class Limbs(NamedTuple):
    """The legs of a model."""

    base: int  # body that carries the free joint
    legs: tuple[Limb, ...]
    guesses: tuple[str, ...]  # assumptions, for the user to check, one line each


def find_limbs(source: Source, named: tuple[str, ...] = ()) -> Limbs:
    """The base and the legs of a model.

    Args:
        source: the model.
        named: bodies that are feet, or carry them. If empty, limbs whose last part is named as a foot are
            taken, or else those that reach lowest.

    Raises:
        UserError: there are fewer than two feet, a foot is named twice, or a joint of a leg is not an
            independent hinge.
    """
    model = source.model
    base = base_of(model)
    ends = _ends(model, base)
    if not ends:
        raise UserError(f"{source.path} has no joints that move a limb of '{model.body(base).name}'")
    depth = _depths(source, base, ends)
    named_as_feet = {end: _named_as_feet(model, _welded(model, end)) for end in ends}
    if named:
        feet, reason = _by_name(source, ends, named), ""  # no guess
    elif sum(bool(named_as_feet[end]) and depth[end] > 0 for end in ends) >= MIN_FEET:
        feet, reason = [end for end in ends if named_as_feet[end] and depth[end] > 0], "by their names"
    else:
        feet = [end for end in ends if depth[end] >= MIN_DEPTH_SHARE * max(depth.values()) > 0]
        _refuse_hands(source.path, model, feet)
        reason = "as the lowest limbs with all joints at zero"
    if len(feet) < MIN_FEET:
        raise UserError(_no_feet(source.path, model, base, feet))
    legs = tuple(_limb(model, base, end, named_as_feet[end]) for end in feet)
    for leg in legs:
        _check(leg, source)
    guess = f"feet: {_listed(model, feet)}, taken {reason}{_as_low(model, feet, depth)}"
    return Limbs(base, legs, () if named else (guess,))


def base_of(model: mujoco.MjModel) -> int:
    """The body with a free joint whose tree has the most joints."""
    free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
    joints = [int(model.body_jntnum[model.body_rootid == root].sum()) for root in free]
    return int(free[int(np.argmax(joints))])


def _ends(model: mujoco.MjModel, base: int) -> list[int]:
    """Bodies with a joint and without moving children."""
    tops = [b for b in range(base + 1, model.nbody) if model.body_jntnum[b] and model.body_rootid[b] == base]
    parents = {int(model.body_weldid[model.body_parentid[top]]) for top in tops}
    return [top for top in tops if top not in parents]


def _welded(model: mujoco.MjModel, top: int) -> list[int]:
    """A body and the bodies fixed to it."""
    return np.flatnonzero(model.body_weldid == top).tolist()


def _depths(source: Source, base: int, ends: list[int]) -> dict[int, float]:
    """Depth of the lowest point of each limb's end below the base's origin, m."""
    model = source.model
    data = pose_of(model, frozen_pose(model, set()))
    up = np.array([0.0, 0.0, 1.0])
    depth = {}
    for end in ends:
        lows = [data.xpos[end][2]]
        for geom in np.flatnonzero(np.isin(model.geom_bodyid, _welded(model, end))).tolist():
            shape = geom_shape(source, geom)
            if shape is not None:
                body = model.geom_bodyid[geom]
                axes = data.xmat[body].reshape(3, 3)
                lows.append((data.xpos[body] + axes @ lowest_point(shape, axes.T @ up))[2])
        depth[end] = float(data.xpos[base][2] - min(lows))
    return depth


def _named_as_feet(model: mujoco.MjModel, bodies: list[int]) -> frozenset[str]:
    """Bodies that are named as feet, or carry geoms or sites that are."""
    found = {body for body in bodies if FOOT_NAME.search(model.body(body).name)}
    if not found:
        geoms = [g for g in range(model.ngeom) if FOOT_NAME.search(model.geom(g).name)]
        sites = [s for s in range(model.nsite) if FOOT_NAME.search(model.site(s).name)]
        carrying = {*model.geom_bodyid[geoms].tolist(), *model.site_bodyid[sites].tolist()}
        found = carrying & set(bodies)
    return frozenset(model.body(body).name for body in found)


def _by_name(source: Source, ends: list[int], named: tuple[str, ...]) -> list[int]:
    model, found = source.model, []
    for name in named:
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        top = int(model.body_weldid[body]) if body >= 0 else -1
        if top not in ends:
            known = _listed(model, ends)
            what = "there is no link" if body < 0 else "no limb ends in"
            raise UserError(f"{source.path}: {what} '{name}': limbs end in {known}")
        if top in found:
            raise UserError(f"{source.path}: the limb of '{name}' is named twice: name each foot once")
        found.append(top)
    if len(found) < MIN_FEET:
        raise UserError(f"{source.path}: a robot has at least {MIN_FEET} feet: name all of them")
    return found


def _listed(model: mujoco.MjModel, ends: list[int]) -> str:
    return ", ".join(model.body(end).name for end in ends)


def _as_low(model: mujoco.MjModel, feet: list[int], depth: dict[int, float]) -> str:
    """Words about other limbs that reach about as low as the feet, as a dog's fore legs named as hands."""
    lowest = max(depth[end] for end in feet)
    others = [end for end in depth if end not in feet and depth[end] >= MIN_DEPTH_SHARE * lowest > 0]
    if not others:
        return ""
    names = _listed(model, others)
    return f"; {names} reach about as low: if the robot stands on them, too, name all feet with --feet"


def _no_feet(path: Path, model: mujoco.MjModel, base: int, found: list[int]) -> str:
    only = f"only one foot, {model.body(found[0]).name}," if found else "no feet"
    return (
        f"{path}: {only} found: with all joints at zero, limbs should reach below"
        f" '{model.body(base).name}'; if it has legs, name their last links with --feet, or"
        " the axis that points up with --up"
    )


def _refuse_hands(path: Path, model: mujoco.MjModel, feet: list[int]) -> None:
    """Raise UserError if limbs that were chosen as the lowest end in hands or wheels by their names."""
    names = [name for end in feet for name in _names(model, end) if NO_FOOT_NAME.search(name)]
    if names:
        raise UserError(
            f"{path}: its lowest limbs end in {', '.join(names)}, which are not named as feet: footfall"
            " needs machines with legs; if these are legs, name their last links with --feet; if another axis"
            " than z points up, give --up"
        )


def _names(model: mujoco.MjModel, end: int) -> list[str]:
    """Names of the bodies at the end of a limb."""
    return [model.body(body).name for body in _welded(model, end)]


def _limb(model: mujoco.MjModel, base: int, end: int, named_as_feet: frozenset[str]) -> Limb:
    chain: list[str] = []
    body = end
    while body != base:
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        chain[:0] = [model.joint(joint).name for joint in range(first, first + count)]
        body = int(model.body_parentid[body])
    return Limb(tuple(chain), tuple(_welded(model, end)), named_as_feet)


def _check(leg: Limb, source: Source) -> None:
    for finding in _unfit(leg, source):
        raise UserError(f"{source.path}: {finding}")


def _unfit(leg: Limb, source: Source) -> Iterator[str]:
    for name in leg.joints:
        joint = source.model.joint(name)
        if joint.type[0] != mujoco.mjtJoint.mjJNT_HINGE:
            kind = mujoco.mjtJoint(joint.type[0]).name.removeprefix("mjJNT_").lower()
            yield f"joint {name} of a leg is a {kind} joint: footfall's legs are made of hinges"
        if name in source.coupled:
            yield f"joint {name} of a leg follows another one: footfall has a motor for each joint of a leg"
