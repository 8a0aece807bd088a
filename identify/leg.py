"""One leg on a fixed base: the mechanical model whose motion is fitted."""

from dataclasses import dataclass

import mujoco
import numpy as np

from footfall.robots.actuator import Motor
from footfall.robots.actuator_net import ActuatorNet
from footfall.robots.description import Robot
from footfall.robots.model import training_spec
from footfall.robots.stability import PLANT_TIMESTEP_S

# Parts of a physics step that have no effect on this model.
_UNUSED = (
    mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    | mujoco.mjtDisableBit.mjDSBL_CONTACT
    | mujoco.mjtDisableBit.mjDSBL_ACTUATION
    | mujoco.mjtDisableBit.mjDSBL_SENSOR
)


@dataclass(frozen=True)
class FixedLeg:
    """A leg whose base does not move. Arrays (n,) are in the order of its joints from the base outwards."""

    name: str
    model: mujoco.MjModel  # n hinges, no contacts, no friction or damping: those are in the joint law
    joints: np.ndarray  # (n,) indices of its joints in the robot's joint order
    joint_names: tuple[str, ...]
    body_names: tuple[str, ...]  # its moving bodies, in the model's order
    armature: np.ndarray  # nominal, kg m^2, (n,)
    motor: Motor  # nominal, fields (n,)
    net: ActuatorNet | None = None  # learned part of the joint law

    @property
    def count(self) -> int:
        """Number of joints."""
        return len(self.joints)


def fixed_legs(robot: Robot) -> tuple[FixedLeg, ...]:
    """All legs of a robot, in the order of its feet."""
    return tuple(_fixed_leg(robot, leg) for leg in range(len(robot.description.feet)))


def _fixed_leg(robot: Robot, leg: int) -> FixedLeg:
    foot, joints = robot.description.feet[leg], robot.foot_joints[leg]
    spec = training_spec(robot, PLANT_TIMESTEP_S)
    for item in [*spec.pairs, *spec.geoms, *spec.equalities, *spec.tendons]:
        spec.delete(item)
    for joint in list(spec.joints):
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            spec.delete(joint)
    kept = {body for name in foot.joints for body in _with_ancestors(spec.joint(name).parent)}
    for body in list(spec.bodies[1:]):
        if body.name not in kept and body.parent.name in {*kept, "world"}:
            spec.delete(body)
    spec.option.disableflags |= _UNUSED
    model = spec.compile()
    _, dofs = joint_addresses_of(model, foot.joints)
    assert dofs == list(range(len(joints))), f"{foot.name}: its joints are not a chain"
    bodies = tuple(model.body(int(model.jnt_bodyid[joint])).name for joint in range(model.njnt))
    motor = robot.motor._replace(**{
        name: np.broadcast_to(value, len(robot.joint_names))[joints]
        for name, value in robot.motor._asdict().items()
        if value is not None
    })  # fmt: skip
    net = None if robot.actuator_net is None else robot.actuator_net.of(joints)
    return FixedLeg(foot.name, model, joints, foot.joints, bodies, robot.armature[joints], motor, net)


def joint_addresses_of(model: mujoco.MjModel, names: tuple[str, ...]) -> tuple[list[int], list[int]]:
    """Addresses of joints in `qpos` and `qvel`."""
    ids = [model.joint(name).id for name in names]
    return [int(model.jnt_qposadr[each]) for each in ids], [int(model.jnt_dofadr[each]) for each in ids]


def _with_ancestors(body: mujoco.MjsBody) -> list[str]:
    """Names of a body and of its ancestors."""
    names = []
    while body is not None and body.name != "world":
        names.append(body.name)
        body = body.parent
    return names
