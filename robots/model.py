"""MuJoCo models derived from one MJCF: the plant of the simulated robot and the reduced training model."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.actuator import Motor
from footfall.robots.description import Robot
from footfall.robots.feet import find_feet, foot_geoms
from footfall.robots.leg_bodies import leg_of_bodies
from footfall.robots.mjcf import load_spec
from footfall.robots.self_contact import Contacts, add_self_contacts
from footfall.robots.spec_edits import (
    FLOOR_FRICTION,
    add_floor,
    collides,
    leave_losses_to_the_joint_law,
    let_feet_decide,
    make_inertia_explicit,
)
from footfall.robots.stability import PLANT_TIMESTEP_S, TRAINING_TIMESTEP_S

IMU = "footfall_imu"

EXACT_ITERATIONS = 4  # of MuJoCo's solver, until friction has nearly converged


def training_model(
    robot: Robot,
    timestep_s: float = TRAINING_TIMESTEP_S,
    contacts: Contacts = "feet",
    exact_friction: bool = False,
) -> mujoco.MjModel:
    """The model that policies are trained on; see `training_spec`."""
    return training_spec(robot, timestep_s, contacts, exact_friction).compile()


def training_spec(
    robot: Robot,
    timestep_s: float = TRAINING_TIMESTEP_S,
    contacts: Contacts = "feet",
    exact_friction: bool = False,
) -> mujoco.MjSpec:
    """The robot's bodies, its feet and a floor, without sensors, actuators and visual geometry.

    Contacts exist between feet and floor and between the pairs of geoms that the MJCF lists. There are no
    constraint rows for joint limits and friction: targets stay inside soft limits, and the joint law contains
    the friction. Fewer rows make the physics faster.

    Args:
        robot: the robot.
        timestep_s: time step of the physics.
        contacts: which shapes collide. For robots that fall and lie, all collision shapes collide with the
            floor and each other, and joints keep their limits, which a lying robot's weight reaches.
        exact_friction: whether contacts have the robot's own friction cone, which takes more iterations. With
            a pyramid and one iteration, feet under load creep, and brake harder than their friction permits.
    """
    spec = load_spec(robot.xml_path)
    make_inertia_explicit(spec)
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for sensor in list(spec.sensors):
        spec.delete(sensor)
    for key in list(spec.keys):
        spec.delete(key)
    feet = {name for foot in robot.description.feet for name in foot.geoms}
    whole_body = contacts != "feet"
    if whole_body:
        for number, geom in enumerate(spec.geoms):
            geom.name = geom.name or f"unnamed_geom_{number}"  # pairs refer to geoms by name
        for pair in list(spec.pairs) if contacts == "true_limbs" else ():
            spec.delete(pair)
        add_self_contacts(spec, rough=contacts in ("rough_limbs", "true_limbs"))
    paired = {name for pair in spec.pairs for name in (pair.geomname1, pair.geomname2)}
    for geom in list(spec.geoms):
        touches_ground = whole_body and collides(geom)
        if not touches_ground and geom.name not in feet | paired:
            spec.delete(geom)
            continue
        geom.contype, geom.conaffinity = 0, int(touches_ground or geom.name in feet)
        # MuJoCo's rule for two geoms without priority, see `let_feet_decide`.
        if touches_ground and geom.name not in feet:
            geom.friction = np.maximum(geom.friction, FLOOR_FRICTION)
    for joint in () if whole_body else spec.joints:
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    leave_losses_to_the_joint_law(spec, robot)
    let_feet_decide(add_floor(spec, contact_bits=1), [spec.geom(foot) for foot in feet])
    spec.option.timestep = timestep_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    if not exact_friction:
        spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
        spec.option.impratio = 1
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.iterations = EXACT_ITERATIONS if exact_friction else 1
    spec.option.ls_iterations = 5
    # The joint law contains the damping. MuJoCo's implicit damping would factorise the mass matrix twice.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    return spec


class Plant(NamedTuple):
    """The body of the simulated robot, and the joint losses of its file."""

    model: mujoco.MjModel
    motor: Motor  # the robot's motors, with the plant's joint friction and damping if its file gives any
    base: int  # body that carries the free joint
    feet: tuple[np.ndarray, ...]  # geoms of each foot, empty for a foot that is not found (`find_feet`)
    leg_of_body: np.ndarray  # (nbody,) foot of the leg that each body belongs to, or NO_LEG (`leg_of_bodies`)
    notes: tuple[str, ...]  # missing values of the file and their replacements, one line each

    @property
    def foot_geoms(self) -> list[int]:
        """Geoms of all feet, foot by foot."""
        return [geom for geoms in self.feet for geom in geoms.tolist()]


def plant_model(robot: Robot, path: Path | None = None) -> mujoco.MjModel:
    """The model of a plant (see `read_plant`)."""
    return read_plant(robot, path).model


def read_plant(
    robot: Robot,
    path: Path | None = None,
    change: Callable[[mujoco.MjSpec], None] | None = None,
    visual: bool = True,
) -> Plant:
    """The body of the simulated robot: full collision geometry, joint limits, an IMU, a floor.

    Pairs of geoms that replace others in training are removed.

    Args:
        robot: the plant must have its joint names.
        path: another MJCF than the robot's own. Its actuators, sensors and keyframes are dropped (the
            simulated robot adds its own motors and IMU). Masses, geometry, reflected inertia, joint friction
            and damping are kept if the file has them; otherwise they are the robot's. A floor is added if no
            plane or height field can collide.
        change: function that changes the MJCF before it is compiled; it may replace the ground.
        visual: whether to keep geoms that cannot collide. Without them a physics step takes less time.

    Raises:
        UserError: the file cannot be read, lacks a joint, or has no free base.
    """
    source = path or robot.xml_path
    spec = load_spec(source)
    _check_plant(spec, robot, source)
    notes = []
    for item in [*spec.actuators, *spec.sensors, *spec.keys]:
        spec.delete(item)
    joints = [spec.joint(name) for name in robot.joint_names]
    losses = {
        "friction": np.array([_first(joint.frictionloss) for joint in joints]),
        "damping": np.array([_first(joint.damping) for joint in joints]),
    }
    _drop_pairs_of_stand_ins(spec)
    leave_losses_to_the_joint_law(spec, robot)
    if not any(_first(joint.armature) for joint in joints):
        notes.append(f"{source.name} gives no reflected inertia: the robot's is used")
        for joint, armature in zip(joints, robot.armature, strict=True):
            joint.armature = armature
    if change is not None:
        change(spec)
    elif not any(_is_ground(geom) for geom in spec.worldbody.geoms):
        add_floor(spec)
    _add_imu(spec, robot)
    spec.option.timestep = PLANT_TIMESTEP_S
    if spec.option.integrator == mujoco.mjtIntegrator.mjINT_RK4:
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.compiler.discardvisual = not visual
    try:
        model = spec.compile()
    except ValueError as error:
        raise UserError(f"{source} does not compile: {' '.join(str(error).split())}") from None
    if model.ntree == 1:  # a robot alone is one island: MuJoCo need not search for others
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ISLAND
    feet = find_feet(model, robot.description, robot.xml_path)
    notes += _notes_on_feet(model, feet, robot, source.name)
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0]
    motor = robot.motor._replace(**{name: loss for name, loss in losses.items() if loss.any()})
    leg_of_body = leg_of_bodies(model, [foot.joints for foot in robot.description.feet])
    return Plant(model, motor, int(model.jnt_bodyid[free]), feet, leg_of_body, tuple(notes))


def _notes_on_feet(
    model: mujoco.MjModel, feet: tuple[np.ndarray, ...], robot: Robot, source: str
) -> list[str]:
    """Notes on feet that were found by position or not at all."""
    given = robot.description.feet
    notes = []
    absent = [", ".join(foot.geoms) for foot, geoms in zip(given, feet, strict=True) if not len(geoms)]
    if absent:
        notes.append(f"{source} has no geom {', '.join(absent)}: these feet are not recorded")
    found = []
    for foot, geoms in zip(given, feet, strict=True):
        renamed = [geom for geom in geoms.tolist() if model.geom(geom).name not in foot.geoms]
        if renamed:
            names = ", ".join(model.geom(geom).name or f"geom {geom}" for geom in renamed)
            body = model.body(model.geom_bodyid[renamed[0]]).name
            found.append(f"{', '.join(foot.geoms)} is {names} of body {body}")
    return notes + ([f"feet of {source} found by position: {', '.join(found)}"] if found else [])


def joint_addresses(model: mujoco.MjModel, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the robot's joints in `qpos` and `qvel`, each of shape (n,), in joint order."""
    ids = [model.joint(name).id for name in robot.joint_names]
    return model.jnt_qposadr[ids], model.jnt_dofadr[ids]


def ground_friction(model: mujoco.MjModel, robot: Robot) -> np.ndarray:
    """Coefficient of sliding friction of each foot on the floor of a training model, shape (feet,).

    MuJoCo takes the larger of two geoms' coefficients unless one of them has priority.
    """
    feet = [geoms[0] for geoms in foot_geoms(model, robot.description)]  # the geoms of one foot are identical
    floor = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)[0]
    of_feet, of_floor = model.geom_friction[feet, 0], model.geom_friction[floor, 0]
    has_priority = model.geom_priority[feet] > model.geom_priority[floor]
    return np.where(has_priority, of_feet, np.maximum(of_feet, of_floor))


def _check_plant(spec: mujoco.MjSpec, robot: Robot, path: Path) -> None:
    kinds = {joint.name: joint.type for joint in spec.joints}
    missing = [name for name in robot.joint_names if name not in kinds]
    if missing:
        raise UserError(
            f"{path}: no joint '{missing[0]}', which robot '{robot.name}' has"
            f" ({len(missing)} of {len(robot.joint_names)} joints missing)"
        )
    for name in robot.joint_names:
        if kinds[name] != mujoco.mjtJoint.mjJNT_HINGE:
            raise UserError(f"{path}: joint '{name}' is not a hinge")
    if mujoco.mjtJoint.mjJNT_FREE not in kinds.values():
        raise UserError(f"{path}: no free joint, so the base cannot move")


def _first(value: Any) -> float:
    """A joint property that MjSpec gives as a number or, in some releases, as an array of one or more."""
    return float(np.ravel(value)[0])


def _drop_pairs_of_stand_ins(spec: mujoco.MjSpec) -> None:
    """Delete pairs of geoms that replace others in training: the plant keeps its true shapes.

    Such a geom cannot collide by itself, while other geoms of its body can.
    """
    for pair in list(spec.pairs):
        geoms = [spec.geom(name) for name in (pair.geomname1, pair.geomname2)]
        if all(not collides(geom) and any(map(collides, geom.parent.geoms)) for geom in geoms):
            spec.delete(pair)


def _is_ground(geom: mujoco.MjsGeom) -> bool:
    return geom.type in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD) and collides(geom)


def _add_imu(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Add an accelerometer at the robot's IMU, aligned with the base's axes."""
    base = next(j.parent for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE)
    base.add_site(name=IMU, pos=imu_position(robot))
    spec.add_sensor(
        name=IMU,
        type=mujoco.mjtSensor.mjSENS_ACCELEROMETER,
        objtype=mujoco.mjtObj.mjOBJ_SITE,
        objname=IMU,
    )


def imu_position(robot: Robot) -> np.ndarray:
    """Position of the IMU in the base's frame, m, shape (3,)."""
    spec = load_spec(robot.xml_path)
    return np.array(spec.site(robot.description.imu).pos)
