"""The bodies of a compiled MuJoCo model as MJCF for MotrixSim.

The text is written from the compiled model, which holds masses, inertias, rotor inertia and friction as
simulated, including those of a randomised robot. Each hinge gets a motor, through which the joint law's
torque acts.
"""

from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement, tostring

import mujoco
import numpy as np

from footfall.plant.engines.shared import FREE, HINGE, WORLD, check_model, collidable

SHAPES = {
    mujoco.mjtGeom.mjGEOM_PLANE: "plane",
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "ellipsoid",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
}


def motrix_mjcf(model: mujoco.MjModel) -> str:
    """MJCF of the model's bodies; bodies, joints and geoms are named by their index.

    Raises:
        UserError: the model has features that this engine does not simulate.
    """
    check_model("motrixsim", model, SHAPES, {})
    root = Element("mujoco")
    SubElement(root, "compiler", angle="radian", autolimits="false")
    SubElement(root, "option", timestep=repr(model.opt.timestep), gravity=_text(model.opt.gravity))
    world = SubElement(root, "worldbody")
    bodies = {WORLD: world}
    for body in range(1, model.nbody):
        bodies[body] = _body(bodies[model.body_parentid[body]], model, body)
    for geom in np.flatnonzero(collidable(model)).tolist():
        _geom(bodies[model.geom_bodyid[geom]], model, geom)
    _contacts(root, model)
    motors = SubElement(root, "actuator")
    for joint in hinges(model):
        SubElement(
            motors, "motor", name=f"motor_{joint}", joint=f"joint_{joint}", gear="1", ctrllimited="false"
        )
    return tostring(root, encoding="unicode")


def hinges(model: mujoco.MjModel) -> list[int]:
    """Joints that have a motor, in the order of the motors."""
    return np.flatnonzero(model.jnt_type == HINGE).tolist()


def _body(parent: Element, model: mujoco.MjModel, body: int) -> Element:
    element = SubElement(
        parent,
        "body",
        name=f"body_{body}",
        pos=_text(model.body_pos[body]),
        quat=_text(model.body_quat[body]),
    )
    SubElement(
        element,
        "inertial",
        mass=repr(float(model.body_mass[body])),
        pos=_text(model.body_ipos[body]),
        quat=_text(model.body_iquat[body]),
        diaginertia=_text(model.body_inertia[body]),
    )
    first = int(model.body_jntadr[body])
    for joint in range(first, first + int(model.body_jntnum[body])):
        name = f"joint_{joint}"
        if model.jnt_type[joint] == FREE:
            SubElement(element, "freejoint", name=name)
            continue
        dof = int(model.jnt_dofadr[joint])
        SubElement(
            element,
            "joint",
            name=name,
            pos=_text(model.jnt_pos[joint]),
            axis=_text(model.jnt_axis[joint]),
            limited="true" if model.jnt_limited[joint] else "false",
            range=_text(model.jnt_range[joint]),
            ref=repr(float(model.qpos0[model.jnt_qposadr[joint]])),
            armature=repr(float(model.dof_armature[dof])),
            damping=repr(float(model.dof_damping[dof])),
            frictionloss=repr(float(model.dof_frictionloss[dof])),
        )
    return element


def _geom(body: Element, model: mujoco.MjModel, geom: int) -> None:
    SubElement(
        body,
        "geom",
        name=f"geom_{geom}",
        type=SHAPES[mujoco.mjtGeom(model.geom_type[geom])],
        size=_text(model.geom_size[geom]),
        pos=_text(model.geom_pos[geom]),
        quat=_text(model.geom_quat[geom]),
        contype=str(model.geom_contype[geom]),
        conaffinity=str(model.geom_conaffinity[geom]),
        condim=str(model.geom_condim[geom]),
        priority=str(model.geom_priority[geom]),
        friction=_text(model.geom_friction[geom]),
        mass="0",
    )


def _contacts(root: Element, model: mujoco.MjModel) -> None:
    contact = SubElement(root, "contact")
    for pair in range(model.npair):
        SubElement(
            contact,
            "pair",
            geom1=f"geom_{model.pair_geom1[pair]}",
            geom2=f"geom_{model.pair_geom2[pair]}",
            condim=str(model.pair_dim[pair]),
            friction=_text(model.pair_friction[pair]),
        )
    for signature in model.exclude_signature.tolist():
        SubElement(contact, "exclude", body1=f"body_{signature >> 16}", body2=f"body_{signature & 0xFFFF}")


def _text(values: Iterable[float]) -> str:
    return " ".join(repr(float(each)) for each in values)
