"""Changes of a sample to the fields of a MuJoCo model, for NumPy and JAX arrays."""

from typing import Any

import mujoco
import numpy as np

from footfall.domain_rand.quantity import BodyMap
from footfall.domain_rand.randomisation import QUANTITIES
from footfall.domain_rand.sample import Sample
from footfall.robots.description import Robot
from footfall.robots.feet import find_feet
from footfall.robots.model import joint_addresses

WORLD = 0  # body
GROUND_SHAPES = (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_BOX)
Array = Any


def body_map(model: mujoco.MjModel, robot: Robot) -> BodyMap:
    """Find a robot's parts in a model (its own, or another plant with the same joint names)."""
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0]
    feet = np.concatenate(find_feet(model, robot.description, robot.xml_path))
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    has_ground_shape = np.isin(model.geom_type, GROUND_SHAPES)
    ground = np.flatnonzero((model.geom_bodyid == WORLD) & collides & has_ground_shape)
    geoms = np.union1d(feet, ground)
    if not len(feet):  # a plant with unknown feet: all geoms that can touch the ground
        geoms = np.flatnonzero(collides)
    _, dofs = joint_addresses(model, robot)
    return BodyMap(int(model.jnt_bodyid[free]), tuple(geoms.tolist()), tuple(dofs.tolist()))


def randomised_field_names() -> tuple[str, ...]:
    """The model fields that a sample may change."""
    effects = [quantity.model for quantity in QUANTITIES.values() if quantity.model is not None]
    return tuple(dict.fromkeys(field for effect in effects for field in effect.fields))


def randomised_fields(model: Any, sample: Sample, where: BodyMap) -> dict[str, Array]:
    """Changed model fields of a sampled robot, by the name of the `MjModel` field.

    Args:
        model: an `MjModel` or an `mjx.Model`, nominal; read only.
        sample: one draw.
        where: indices of the robot's parts in this model.

    A mass scale also scales the body's inertia. A payload is a point mass at the base's centre of
    mass: it adds weight and leaves the inertia about that point. Derived constants that MuJoCo keeps for
    constraint scaling (`body_invweight0`, `dof_invweight0`) stay nominal in the dictionary; the C plant
    recomputes them (see `apply_to_model`).
    """
    changed: dict[str, Array] = {}
    for name, quantity in QUANTITIES.items():
        if quantity.model is not None and name in sample:
            for field in quantity.model.fields:
                current = changed.get(field, getattr(model, field))
                changed[field] = quantity.model.change(current, sample[name], where)
    return changed


def apply_to_model(model: mujoco.MjModel, sample: Sample, where: BodyMap) -> None:
    """Change a compiled MuJoCo model, in place, to the sampled robot.

    `mj_setConst` updates everything that depends on the fields: derived constants, which frames coincide
    (`body_sameframe`), and the bounding volumes of bodies, without which contacts of a base with a moved
    centre of mass would be missed.
    """
    for name, value in randomised_fields(model, sample, where).items():
        getattr(model, name)[:] = value
    mujoco.mj_setConst(model, mujoco.MjData(model))
