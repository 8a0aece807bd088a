"""How a sample changes the fields of a MuJoCo model: arithmetic for NumPy and JAX arrays alike."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from footfall.domain_rand.sample import Sample
from footfall.robots.description import Robot
from footfall.robots.feet import find_feet
from footfall.robots.model import joint_addresses

Array = Any


@dataclass(frozen=True)
class BodyMap:
    """Where the parts that a sample speaks of lie in a model."""

    base: int  # body
    contact_geoms: tuple[int, ...]  # geoms whose friction decides foot-ground contact
    dofs: tuple[int, ...]  # the joints', in joint order


def body_map(model: mujoco.MjModel, robot: Robot) -> BodyMap:
    """Find a robot's parts in a model (its own, or another plant with the same joint names)."""
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0]
    feet = find_feet(model, robot)
    planes = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    geoms = np.union1d(feet[feet >= 0], planes)
    if (feet < 0).all():  # a plant whose feet nobody found: whatever can touch the ground
        geoms = np.flatnonzero((model.geom_contype | model.geom_conaffinity) != 0)
    _, dofs = joint_addresses(model, robot)
    return BodyMap(int(model.jnt_bodyid[free]), tuple(geoms.tolist()), tuple(dofs.tolist()))


def randomised_fields(model: Any, sample: Sample, where: BodyMap) -> dict[str, Array]:
    """Changed model fields of a sampled robot, by the name of the `MjModel` field.

    Args:
        model: an `MjModel` or an `mjx.Model`, nominal; read only.
        sample: one draw.
        where: the robot's parts in this model.

    A mass scale carries the body's inertia with it. A payload is a point mass at the base's centre of
    mass: it adds weight and leaves the inertia about that point. Derived constants that MuJoCo keeps for
    constraint scaling (`body_invweight0`, `dof_invweight0`) stay nominal in the dictionary; the C plant
    recomputes them (see `apply_to_model`).
    """
    changed: dict[str, Array] = {}
    mass, inertia = model.body_mass, model.body_inertia
    xp = mass.__array_namespace__()
    if sample.link_mass is not None:
        scale = xp.concat([xp.ones(1, dtype=mass.dtype), sample.link_mass])
        mass, inertia = mass * scale, inertia * scale[:, None]
    if sample.payload_kg is not None:
        at_base = xp.asarray(np.arange(mass.shape[0]) == where.base, dtype=mass.dtype)
        mass = mass + at_base * sample.payload_kg
    if sample.inertia is not None:
        scale = xp.concat([xp.ones(1, dtype=mass.dtype), sample.inertia])
        inertia = inertia * scale[:, None]
    if mass is not model.body_mass:
        changed["body_mass"] = mass
    if inertia is not model.body_inertia:
        changed["body_inertia"] = inertia
    if sample.com_offset_m is not None:
        ipos = model.body_ipos
        at_base = xp.asarray(np.arange(ipos.shape[0]) == where.base, dtype=ipos.dtype)
        changed["body_ipos"] = ipos + at_base[:, None] * sample.com_offset_m
    if sample.armature is not None:
        scale = _scatter(xp, model.dof_armature, where.dofs, sample.armature)
        changed["dof_armature"] = model.dof_armature * scale
    if sample.friction is not None:
        friction = model.geom_friction
        sliding = np.zeros(friction.shape, dtype=bool)
        sliding[list(where.contact_geoms), 0] = True
        changed["geom_friction"] = xp.where(xp.asarray(sliding), sample.friction, friction)
    return changed


def apply_to_model(model: mujoco.MjModel, sample: Sample, where: BodyMap) -> None:
    """Turn a compiled MuJoCo model into the sampled robot.

    Derived constants follow, and with them the notes of which frames coincide (`body_sameframe`): a base
    whose centre of mass was at its origin would else keep it there.
    """
    for name, value in randomised_fields(model, sample, where).items():
        getattr(model, name)[:] = value
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _scatter(xp: Any, like: Array, indices: tuple[int, ...], values: Array) -> Array:
    """`values` at `indices`, ones elsewhere, shaped like `like`."""
    place = np.zeros((like.shape[0], len(indices)))
    place[list(indices), np.arange(len(indices))] = 1.0
    rest = np.ones(like.shape[0])
    rest[list(indices)] = 0.0
    return xp.asarray(place, dtype=like.dtype) @ values + xp.asarray(rest, dtype=like.dtype)
