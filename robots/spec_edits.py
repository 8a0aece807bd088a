"""Changes to an `MjSpec` that training's model and the plant share."""

import mujoco
import numpy as np

from footfall.robots.description import Robot

FLOOR = "floor"
FLOOR_FRICTION = [0.8, 0.005, 0.0001]
ALL_CONTACTS = 0x7FFFFFFF  # contact bits that match every geom that can collide


def make_inertia_explicit(spec: mujoco.MjSpec) -> None:
    """Set each body's compiled mass and inertia explicitly, so that deleting geoms does not change them."""
    for number, body in enumerate(spec.bodies):
        body.name = body.name or f"unnamed_body_{number}"  # used to find it below
    model = spec.copy().compile()
    for body in spec.bodies[1:]:
        compiled = model.body(body.name)
        body.mass = compiled.mass[0]
        body.ipos = compiled.ipos
        body.iquat = compiled.iquat
        body.inertia = compiled.inertia
        body.fullinertia = [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0]  # MjSpec's marker for: not given
        body.explicitinertial = True


def leave_losses_to_the_joint_law(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Remove friction, a constraint row, from all joints, and viscous damping from the motors' joints."""
    for joint in spec.joints:
        joint.frictionloss = 0.0
    for name in robot.joint_names:
        joint = spec.joint(name)
        joint.damping = np.zeros_like(joint.damping)


def let_feet_decide(floor: mujoco.MjsGeom, feet: list[mujoco.MjsGeom]) -> None:
    """Give contacts the feet's parameters through a neutral floor instead of through `priority`.

    The result is the same. MJX handles priorities by scatters, which are slow on a GPU.
    """
    if all(foot.priority > 0 for foot in feet):
        floor.condim, floor.solmix, floor.friction = 1, 0.0, [0.0, 0.0, 0.0]
        for foot in feet:
            foot.priority, foot.solmix = 0, 1.0


def add_floor(spec: mujoco.MjSpec, contact_bits: int = ALL_CONTACTS) -> mujoco.MjsGeom:
    """Add an infinite plane at height 0; it is named `FLOOR` unless another geom has this name."""
    name_exists = any(geom.name == FLOOR for geom in spec.geoms)
    return spec.worldbody.add_geom(
        name="" if name_exists else FLOOR,
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 1],
        contype=contact_bits,
        conaffinity=contact_bits,
        friction=FLOOR_FRICTION,
    )


def collides(geom: mujoco.MjsGeom) -> bool:
    """Whether a geom can collide by itself, not only through a pair."""
    return bool(geom.contype or geom.conaffinity)
