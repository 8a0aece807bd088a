"""Interface between the environment and a physics engine: the robot's motion over one control step.

Engines differ only in the integration of the bodies (`mjx.py`, `c.py`, `generated/`).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from footfall.robots.actuator import (
    JointCommand,
    Lag,
    Motor,
    friction_torque,
    joint_damping,
    lagged,
    motor_torque,
)
from footfall.robots.actuator_net import ActuatorNet, inputs_of, learned_torque

Array = Any  # a NumPy or a JAX array


class Motion(NamedTuple):
    """State carried from one physics step to the next."""

    qpos: Array  # (nq,)
    qvel: Array  # (nv,)
    qacc_warmstart: Array  # (nv,)
    lagged_torque: Array | None = None  # (n,) N m, of the motors; None for motors without lag
    net_memory: Array | None = None  # (n, m, inputs) of the actuator net; None for robots without one


def bodies(motion: Motion) -> dict[str, Array]:
    """MuJoCo's part of a motion, by the field's name in MjData."""
    return {name: getattr(motion, name) for name in ("qpos", "qvel", "qacc_warmstart")}


class Drive(NamedTuple):
    """Motor inputs and parameters that are constant during one control step."""

    target: Array  # (substeps, n) rad, position target that has reached the motors at each physics step
    kp: Array  # (n,) N m/rad
    kd: Array  # (n,) N m s/rad
    motor: Motor
    encoder_bias: Array  # (n,) rad
    lag: Lag | None = None  # of the motors' torque over a physics step, (n,)


class Trace(NamedTuple):
    """Records of each physics step, oldest first."""

    qpos: Array  # (substeps, nq)
    qvel: Array  # (substeps, nv)
    # (substeps, points, 3) m, centres of all feet's geoms, for which the contact forces were computed.
    foot_position: Array
    torque: Array  # (substeps, n) N m, of the motors


Fields = dict[str, Array]  # model fields in which this robot differs from the nominal one
# Key of a further field, which only the generated physics reads: the ground near each foot point, in the
# world.
# (points, 4): a plane, as its unit normal and its distance from the world's origin, m.
# (points, 8): that plane, which ends at the face of a step up, then the step: horizontal unit normal (2) that
# points out of the face, the face's distance from the origin along that normal, m, and the step's height, m.
GROUND = "ground"
# Key of another such field: gravity in the world, m/s^2, (3,). A slope is level ground with tilted gravity.
GRAVITY = "gravity"
PLANE_NUMBERS, STEP_NUMBERS = 4, 8
Physics = Callable[[Motion, Drive, Fields], tuple[Motion, Trace]]


class JointEffort(NamedTuple):
    """Torque and inertia of the joints in one physics step, each of shape (..., n)."""

    motor_torque: Array  # N m, of the motors, mean over the step
    torque: Array  # N m, at the joints
    inertia: Array  # kg m^2, to be added to the joints' own during this step
    lagged_torque: Array | None  # N m, motor torque at the end of the step; None without lag
    net_memory: Array | None = None  # of the actuator net at the end of the step; None without one


def joint_effort(
    drive: Drive,
    target: Array,
    position: Array,
    velocity: Array,
    timestep_s: float,
    torque_before: Array | None = None,
    net: ActuatorNet | None = None,
    memory: Array | None = None,
) -> JointEffort:
    """The joint law at the beginning of a physics step, with the terms that keep long steps stable.

    The law's damping D (`joint_damping`) is large for the inertia of a lower leg: integrated explicitly in
    steps of h = 5 ms, speeds change sign from step to step. The trapezoidal rule, with the torque f
    linearised in the velocity, has

        (M + h/2 D) (v' - v) = h f(q, v)

    which is the explicit step of a joint with h/2 D more inertia. Each mode of the velocity is multiplied by
    (2 - x) / (2 + x), x = h D / M, instead of 1 - x: never beyond -1, and of second order in h; for h to 0
    both are the plain law. (Hairer and Wanner, Solving Ordinary Differential Equations II, IV.3 and IV.7.)

    Args:
        drive: motor inputs and parameters; position loops read the biased encoders.
        target: joint targets of this step, rad.
        position: joint positions, rad.
        velocity: joint velocities, rad/s.
        timestep_s: length h of the physics step.
        torque_before: motor torque at the beginning of the step, N m, of motors with lag.
        net: the learned part of the joint law; its slope in the velocity counts as damping.
        memory: memory of the net at the beginning of the step.
    """
    command = JointCommand(target, 0.0, drive.kp, drive.kd, 0.0)
    measured = position + drive.encoder_bias
    torque = motor_torque(command, measured, velocity, drive.motor)
    damping = joint_damping(command, measured, velocity, drive.motor, drive.lag)
    torque_after = None
    if drive.lag is not None:
        torque, torque_after = lagged(torque, torque_before, drive.lag)
    at_joint = torque + friction_torque(velocity, drive.motor, torque)
    if net is not None:
        inputs = inputs_of(net, command, measured, velocity, torque)
        learned = learned_torque(net, inputs, memory, timestep_s)
        at_joint, damping, memory = at_joint + learned.torque, damping + learned.damping, learned.memory
    return JointEffort(torque, at_joint, 0.5 * timestep_s * damping, torque_after, memory)
