"""What a physics engine is to the environment: the robot's motion through one control step.

Engines differ in who integrates the bodies (`envs/physics_mjx.py`, `envs/physics_c.py`), in nothing else.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from footfall.robots.actuator import JointCommand, Motor, friction_torque, motor_torque

Array = Any  # a NumPy or a JAX array


class Motion(NamedTuple):
    """What the physics carries from one physics step to the next."""

    qpos: Array  # (nq,)
    qvel: Array  # (nv,)
    qacc_warmstart: Array  # (nv,)


class Drive(NamedTuple):
    """What the motors hold on to during one control step. The motion does not change it."""

    target: Array  # (substeps, n) rad, as the motors have it at each physics step
    kp: Array  # (n,) N m/rad
    kd: Array  # (n,) N m s/rad
    motor: Motor
    encoder_bias: Array  # (n,) rad


class Trace(NamedTuple):
    """What each physics step left, oldest first."""

    qpos: Array  # (substeps, nq)
    qvel: Array  # (substeps, nv)
    foot_position: Array  # (substeps, feet, 3) m, as the step's forces saw it
    torque: Array  # (substeps, n) N m, of the motors


Fields = dict[str, Array]  # model fields in which this robot differs from the nominal one
Physics = Callable[[Motion, Drive, Fields], tuple[Motion, Trace]]


def drive_torque(drive: Drive, target: Array, position: Array, velocity: Array) -> tuple[Array, Array]:
    """The motors' torque, and what of it reaches the joints, N m, shape (..., n).

    The motor's own position loop runs on its biased encoder.
    """
    command = JointCommand(target, 0.0, drive.kp, drive.kd, 0.0)
    torque = motor_torque(command, position + drive.encoder_bias, velocity, drive.motor)
    return torque, torque + friction_torque(velocity, drive.motor)
