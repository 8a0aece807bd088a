"""The joint law: what torque a motor delivers for a command.

Written once, for NumPy and JAX arrays alike. The MJX environment applies it at each physics step, the
simulated motor applies it behind the bus, and the joint layer predicts torque with it.
"""

from typing import Any, NamedTuple

from footfall.common.arrays import library

Array = Any  # a NumPy or a JAX array


class JointCommand(NamedTuple):
    """The content of a motor command: five arrays in joint order, shape (..., n)."""

    position: Array  # rad
    velocity: Array  # rad/s
    kp: Array  # N m/rad
    kd: Array  # N m s/rad
    torque: Array  # N m, feed-forward

    @classmethod
    def of(cls, values: Array) -> "JointCommand":
        """The command whose rows are those of an array (5, ..., n). Unpacking takes twice as long."""
        return cls(values[0], values[1], values[2], values[3], values[4])


class Motor(NamedTuple):
    """Limits and losses of motors, seen at the joint: arrays that broadcast to (..., n)."""

    peak_torque: Array  # N m, the current limit
    stall_torque: Array  # N m, where the torque-speed line meets zero speed
    no_load_speed: Array  # rad/s
    friction: Array  # N m, Coulomb friction when fully developed
    friction_speed: Array  # rad/s at which Coulomb friction is fully developed
    damping: Array  # N m s/rad, viscous
    strength: Array  # delivered torque over commanded torque; 1 for a nominal motor


def weaker(motor: Motor, share: float) -> Motor:
    """The motor with its torque limits scaled by `share`, 0 to 1, at all speeds."""
    return motor._replace(peak_torque=share * motor.peak_torque, stall_torque=share * motor.stall_torque)


def pd_torque(command: JointCommand, position: Array, velocity: Array) -> Array:
    """Torque of the motor's PD law, N m, before any limit. Shapes (..., n)."""
    return (
        command.kp * (command.position - position)
        + command.kd * (command.velocity - velocity)
        + command.torque
    )


def limit_torque(torque: Array, velocity: Array, motor: Motor) -> Array:
    """Torque that a DC motor can deliver at this speed, N m. Shapes (..., n).

    A current limit caps torque at low speed. The supply voltage less the back-EMF caps it along the line
    from stall torque to no-load speed, in the direction of motion only; past the no-load speed the motor
    can only brake. The current limit holds there too, so it is applied last.
    """
    least, most = _supply_range(velocity, motor)
    xp, peak = library(torque), motor.peak_torque
    within_supply = xp.minimum(xp.maximum(torque, least), most)
    return xp.minimum(xp.maximum(within_supply, -peak), peak)  # as `clip`, in half the time


def _supply_range(velocity: Array, motor: Motor) -> tuple[Array, Array]:
    """Least and greatest torque that the supply voltage allows at this speed, N m."""
    speed = velocity / motor.no_load_speed
    return motor.stall_torque * (-1.0 - speed), motor.stall_torque * (1.0 - speed)


def friction_torque(velocity: Array, motor: Motor) -> Array:
    """Torque lost in the gearbox, N m, opposing motion: Coulomb, ramped through zero, and viscous."""
    xp, most = library(velocity), motor.friction
    least = -most
    coulomb = xp.minimum(xp.maximum(least * (velocity / motor.friction_speed), least), most)
    return coulomb - motor.damping * velocity


def motor_torque(command: JointCommand, position: Array, velocity: Array, motor: Motor) -> Array:
    """Electromagnetic torque at the joint, N m: the PD law within the motor's limits, shape (..., n)."""
    asked = pd_torque(command, position, velocity) * motor.strength
    return limit_torque(asked, velocity, motor)


def joint_torque(command: JointCommand, position: Array, velocity: Array, motor: Motor) -> Array:
    """Torque that reaches the joint, N m: `motor_torque` less friction, shape (..., n).

    Args:
        command: the command.
        position: joint positions, rad.
        velocity: joint velocities, rad/s.
        motor: the motors' parameters.
    """
    return motor_torque(command, position, velocity, motor) + friction_torque(velocity, motor)


def joint_damping(command: JointCommand, position: Array, velocity: Array, motor: Motor) -> Array:
    """Damping of `joint_torque`, N m s/rad: minus its derivative in velocity, (..., n).

    It is the sum of three parts: kd within the limits, the slope of the torque-speed line on that line and
    nothing at the current limit; the ramp of Coulomb friction at low speed; viscous friction. Long physics
    steps integrate it implicitly (envs/physics/interface.py).
    """
    xp = library(velocity)
    asked = pd_torque(command, position, velocity) * motor.strength
    peak = motor.peak_torque
    least, most = (end.clip(-peak, peak) for end in _supply_range(velocity, motor))
    limit = xp.where(asked > most, most, least)
    line = motor.stall_torque / motor.no_load_speed
    limited = xp.where(xp.abs(limit) < motor.peak_torque, line, 0.0)
    delivered = xp.where((asked > most) | (asked < least), limited, command.kd * motor.strength)
    ramp = xp.where(xp.abs(velocity) < motor.friction_speed, motor.friction / motor.friction_speed, 0.0)
    return delivered + ramp + motor.damping
