"""The bodies of a compiled MuJoCo model as a plant of Drake.

Drake's own reader of MJCF ignores friction loss, sites and priorities of contacts. The compiled model holds
masses, inertias, rotor inertia and friction as simulated, including those of a randomised robot.
"""

import logging
from collections.abc import Iterable, Iterator
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import mujoco
import numpy as np
from pydrake.geometry import (
    AddContactMaterial,
    Box,
    Capsule,
    CollisionFilterDeclaration,
    Cylinder,
    Ellipsoid,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    QuaternionFloatingJoint,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
)
from pydrake.systems.framework import Diagram, DiagramBuilder

from footfall.common.errors import UserError
from footfall.plant.engines.shared import FREE, WORLD, check_model, collidable
from footfall.robots.self_contact import adjacent, excluded_bodies

if TYPE_CHECKING:
    from pydrake.geometry import GeometryId

logging.getLogger("drake").setLevel(logging.ERROR)  # a warning about deformable bodies for each half space

ROUND = (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_ELLIPSOID)
MAX_FRICTION = 10.0


class DrakePlant(NamedTuple):
    """A plant of Drake, with the indices of the MuJoCo model's parts in it."""

    diagram: Diagram
    plant: MultibodyPlant
    positions: np.ndarray  # (nq,) index in Drake's positions of each entry of `qpos`
    velocities: np.ndarray  # (nv,) index in Drake's velocities of each entry of `qvel`
    geoms: "dict[GeometryId, int]"  # MuJoCo's geom of each geometry


def drake_plant(model: mujoco.MjModel, feet: list[int]) -> DrakePlant:
    """Build the bodies of a compiled model.

    Args:
        model: one free base, hinges, rigid bodies.
        feet: geoms of the feet.

    Raises:
        UserError: the model has features that this engine does not simulate.
    """
    _check(model, feet)
    builder = DiagramBuilder()
    config = MultibodyPlantConfig(
        time_step=model.opt.timestep, contact_model="point", adjacent_bodies_collision_filters=False
    )
    plant, scene_graph = AddMultibodyPlant(config, builder)
    plant.mutable_gravity_field().set_gravity_vector(model.opt.gravity)
    bodies = [plant.world_body()]
    for body in range(1, model.nbody):
        rotational_inertia = RotationalInertia(*model.body_inertia[body]).ReExpress(
            _pose(model.body_iquat[body], np.zeros(3)).rotation()
        )
        inertia = SpatialInertia.MakeFromCentralInertia(
            model.body_mass[body], model.body_ipos[body], rotational_inertia
        )
        bodies.append(plant.AddRigidBody(f"body_{body}", inertia))
    joints = [_join(plant, model, body, bodies) for body in range(1, model.nbody)]
    geoms = {}
    collides = np.flatnonzero(collidable(model))
    friction = geom_friction(model, collides)
    for geom in collides.tolist():
        properties = ProximityProperties()
        AddContactMaterial(properties, friction=CoulombFriction(friction[geom], friction[geom]))
        pose = _pose(model.geom_quat[geom], model.geom_pos[geom])
        body = bodies[model.geom_bodyid[geom]]
        geoms[
            plant.RegisterCollisionGeometry(body, pose, _shape(model, geom), f"geom_{geom}", properties)
        ] = geom
    filters, shapes = CollisionFilterDeclaration(), {geom: shape for shape, geom in geoms.items()}
    for first, second in non_colliding_pairs(model, shapes):
        filters.ExcludeBetween(GeometrySet(shapes[first]), GeometrySet(shapes[second]))
    scene_graph.collision_filter_manager().Apply(filters)
    plant.Finalize()
    positions, velocities = _state_indices(model, [joint for joint in joints if joint is not None])
    return DrakePlant(builder.Build(), plant, positions, velocities, geoms)


def _check(model: mujoco.MjModel, feet: list[int]) -> None:
    """Raise UserError if Drake would simulate another robot than MuJoCo."""
    not_round = [model.geom(geom).name for geom in feet if mujoco.mjtGeom(model.geom_type[geom]) not in ROUND]
    first = "".join(not_round[:1])
    others = {
        f"foot '{first}', which is not round: contacts are one point for each two geoms": not_round,
        "bodies with several joints": (model.body_jntnum > 1).any(),
        "friction loss in the model": model.dof_frictionloss.any(),
    }
    check_model("drake", model, _SHAPES, others)


def non_colliding_pairs(model: mujoco.MjModel, geoms: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Pairs of these geoms that MuJoCo does not test for contact, the lower id first."""
    listed = {tuple(sorted(pair)) for pair in zip(model.pair_geom1, model.pair_geom2, strict=True)}
    excluded, contype, conaffinity = excluded_bodies(model), model.geom_contype, model.geom_conaffinity
    for first, second in combinations(sorted(geoms), 2):
        lower_body, higher_body = sorted(model.geom_bodyid[[first, second]].tolist())
        bits = contype[first] & conaffinity[second] or contype[second] & conaffinity[first]
        collide = (
            bits
            and not adjacent(model, lower_body, higher_body)
            and (lower_body, higher_body) not in excluded
        )
        if not collide and (first, second) not in listed:
            yield first, second


def geom_friction(model: mujoco.MjModel, collides: np.ndarray) -> dict[int, float]:
    """Coefficients of the geoms with which Drake's contacts with the ground have MuJoCo's friction.

    MuJoCo uses the coefficient of the geom with the higher priority, or else the larger one. Drake uses 2 a b
    / (a + b). The ground's coefficient is free; with the value chosen here, most coefficients stay the same.

    Raises:
        UserError: parts of the ground differ in friction, or a coefficient is too large.
    """
    friction, priority = model.geom_friction[:, 0], model.geom_priority
    ground = [geom for geom in collides.tolist() if model.geom_bodyid[geom] == WORLD]
    others = [geom for geom in collides.tolist() if model.geom_bodyid[geom] != WORLD]
    if len({(friction[geom], priority[geom]) for geom in ground}) > 1:
        raise UserError("--engine drake does not simulate a ground of several frictions: give it one")
    ground_geom = ground[0]
    pair_friction = {
        geom: friction[geom]
        if priority[geom] > priority[ground_geom]
        else friction[ground_geom]
        if priority[geom] < priority[ground_geom]
        else max(friction[geom], friction[ground_geom])
        for geom in others
    }
    if max(pair_friction.values(), default=0.0) >= MAX_FRICTION:
        raise UserError(f"--engine drake does not simulate friction of {MAX_FRICTION:g} or more")
    # a = p b / (2 b - p) must be positive for each pair's p.
    ground_friction = max(float(np.median(list(pair_friction.values()))), 0.6 * max(pair_friction.values()))
    return dict.fromkeys(ground, ground_friction) | {
        geom: value * ground_friction / (2.0 * ground_friction - value)
        for geom, value in pair_friction.items()
    }


def _join(plant: MultibodyPlant, model: mujoco.MjModel, body: int, bodies: list[Any]) -> Any:
    """Join a body to its parent; returns the joint, or None if the body is welded."""
    parent, child = bodies[model.body_parentid[body]], bodies[body]
    pose = _pose(model.body_quat[body], model.body_pos[body])
    if not model.body_jntnum[body]:
        plant.WeldFrames(parent.body_frame(), child.body_frame(), pose)
        return None
    joint = int(model.body_jntadr[body])
    if model.jnt_type[joint] == FREE:
        return plant.AddJoint(
            QuaternionFloatingJoint(f"joint_{joint}", plant.world_frame(), child.body_frame())
        )
    anchor = RigidTransform(model.jnt_pos[joint])
    before = plant.AddFrame(FixedOffsetFrame(f"before_{joint}", parent.body_frame(), pose @ anchor))
    after = plant.AddFrame(FixedOffsetFrame(f"after_{joint}", child.body_frame(), anchor))
    dof = int(model.jnt_dofadr[joint])
    hinge = RevoluteJoint(f"joint_{joint}", before, after, model.jnt_axis[joint], model.dof_damping[dof])
    if model.jnt_limited[joint]:
        low, high = model.jnt_range[joint] - model.qpos0[model.jnt_qposadr[joint]]
        hinge.set_position_limits([low], [high])
    added = plant.AddJoint(hinge)
    rotor = plant.AddJointActuator(f"rotor_{joint}", added)
    rotor.set_default_rotor_inertia(model.dof_armature[dof])
    rotor.set_default_gear_ratio(1.0)
    return added


def _state_indices(model: mujoco.MjModel, joints: list[Any]) -> tuple[np.ndarray, np.ndarray]:
    """`positions` and `velocities` of `DrakePlant`."""
    positions, velocities = np.zeros(model.nq, int), np.zeros(model.nv, int)
    for index, joint in enumerate(joints):
        q, v = model.jnt_qposadr[index], model.jnt_dofadr[index]
        position_start, velocity_start = joint.position_start(), joint.velocity_start()
        if model.jnt_type[index] == FREE:  # Drake: quaternion, position; angular, linear velocity
            positions[q : q + 7] = position_start + np.array([4, 5, 6, 0, 1, 2, 3])
            velocities[v : v + 6] = velocity_start + np.array([3, 4, 5, 0, 1, 2])
        else:
            positions[q], velocities[v] = position_start, velocity_start
    return positions, velocities


def _pose(quaternion: np.ndarray, position: np.ndarray) -> RigidTransform:
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(matrix.reshape(3, 3)), position)


_SHAPES = {
    mujoco.mjtGeom.mjGEOM_PLANE: lambda size: HalfSpace(),
    mujoco.mjtGeom.mjGEOM_SPHERE: lambda size: Sphere(size[0]),
    mujoco.mjtGeom.mjGEOM_CAPSULE: lambda size: Capsule(size[0], 2.0 * size[1]),
    mujoco.mjtGeom.mjGEOM_CYLINDER: lambda size: Cylinder(size[0], 2.0 * size[1]),
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: lambda size: Ellipsoid(*size),
    mujoco.mjtGeom.mjGEOM_BOX: lambda size: Box(*(2.0 * size)),
}


def _shape(model: mujoco.MjModel, geom: int) -> Shape:
    return _SHAPES[mujoco.mjtGeom(model.geom_type[geom])](model.geom_size[geom])
