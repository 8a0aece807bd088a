"""MuJoCo models derived from one MJCF: the plant of the simulated robot and the lean training model."""

from pathlib import Path

import mujoco
import numpy as np

from robots.description import Robot, load_spec
from robots.errors import UserError

FLOOR = "floor"
TRAINING_TIMESTEP_S = 0.005
PLANT_TIMESTEP_S = 0.001


def training_model(robot: Robot, timestep_s: float = TRAINING_TIMESTEP_S) -> mujoco.MjModel:
    """The model that policies are trained on: the robot's bodies, its feet and a floor, nothing else.

    No sensors, actuators or visual geometry; contact between feet and floor only; no joint-limit and no
    friction constraint rows, since the joint law carries joint friction and targets stay inside soft
    limits. Each row left out makes MJX faster.
    """
    spec = load_spec(robot.xml_path)
    _make_inertia_explicit(spec)
    for actuator in list(spec.actuators):
        spec.delete(actuator)
    for sensor in list(spec.sensors):
        spec.delete(sensor)
    for key in list(spec.keys):
        spec.delete(key)
    feet = {foot.geom for foot in robot.description.feet}
    for geom in list(spec.geoms):
        if geom.name not in feet:
            spec.delete(geom)
            continue
        geom.contype, geom.conaffinity = 0, 1
    for joint in spec.joints:
        joint.limited = mujoco.mjtLimited.mjLIMITED_FALSE
    _strip_friction_rows(spec)
    _add_floor(spec)
    spec.option.timestep = timestep_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    spec.option.impratio = 1
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.iterations = 1
    spec.option.ls_iterations = 5
    # Joint damping is part of the joint law; integrating it implicitly would factorise the mass matrix twice.
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_EULERDAMP
    return spec.compile()


def plant_model(robot: Robot, path: Path | None = None) -> mujoco.MjModel:
    """The body of the simulated robot: full collision geometry, joint limits, a floor.

    Args:
        robot: whose joint names the plant must carry.
        path: another MJCF than the robot's own. Its actuators and sensors are dropped (the simulated
            robot adds its own motors and IMU); masses, geometry and joint properties are kept, and a floor
            is added if it has no plane.

    Raises:
        UserError: the file cannot be read, lacks a joint, or has no free base.
    """
    spec = load_spec(path or robot.xml_path)
    for item in [*spec.actuators, *spec.sensors, *spec.keys]:
        spec.delete(item)
    _strip_friction_rows(spec)
    if not any(geom.type == mujoco.mjtGeom.mjGEOM_PLANE for geom in spec.geoms):
        _add_floor(spec)
    spec.option.timestep = PLANT_TIMESTEP_S
    try:
        model = spec.compile()
    except ValueError as error:
        raise UserError(
            f"{path or robot.xml_path} does not compile: {' '.join(str(error).split())}"
        ) from None
    _check_plant(model, robot, path or robot.xml_path)
    return model


def joint_addresses(model: mujoco.MjModel, robot: Robot) -> tuple[np.ndarray, np.ndarray]:
    """Where the robot's joints lie in `qpos` and `qvel`, each of shape (n,), in joint order."""
    ids = [model.joint(name).id for name in robot.joint_names]
    return model.jnt_qposadr[ids], model.jnt_dofadr[ids]


def _check_plant(model: mujoco.MjModel, robot: Robot, path: Path) -> None:
    names = {model.joint(i).name for i in range(model.njnt)}
    missing = [name for name in robot.joint_names if name not in names]
    if missing:
        raise UserError(
            f"{path}: no joint '{missing[0]}', which robot '{robot.name}' has"
            f" ({len(missing)} of {len(robot.joint_names)} joints missing)"
        )
    for name in robot.joint_names:
        if model.joint(name).type != mujoco.mjtJoint.mjJNT_HINGE:
            raise UserError(f"{path}: joint '{name}' is not a hinge")
    if mujoco.mjtJoint.mjJNT_FREE not in model.jnt_type:
        raise UserError(f"{path}: no free joint, so the base cannot move")


def _strip_friction_rows(spec: mujoco.MjSpec) -> None:
    for joint in spec.joints:
        joint.frictionloss = 0.0


def _make_inertia_explicit(spec: mujoco.MjSpec) -> None:
    """Write each body's compiled mass and inertia down, so that deleting geoms cannot change them."""
    model = spec.copy().compile()
    for body in spec.bodies[1:]:
        compiled = model.body(body.name)
        body.mass = compiled.mass[0]
        body.ipos = compiled.ipos
        body.iquat = compiled.iquat
        body.inertia = compiled.inertia
        body.explicitinertial = True


def _add_floor(spec: mujoco.MjSpec) -> None:
    spec.worldbody.add_geom(
        name=FLOOR,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 1],
        contype=1,
        conaffinity=1,
        friction=[0.8, 0.005, 0.0001],
    )
