"""One draw: how a particular robot differs from the nominal one."""

from typing import Any, NamedTuple

from footfall.robots.actuator import JointCommand, Motor

Array = Any


class Sample(NamedTuple):
    """Differences that last for an episode. None means nominal. Shapes as `sample_shapes` gives them.

    Scales multiply the nominal value; the units of the others are in their names or in `Randomisation`.
    """

    friction: Array | None = None
    link_mass: Array | None = None
    payload_kg: Array | None = None
    com_offset_m: Array | None = None
    inertia: Array | None = None
    armature: Array | None = None
    joint_friction: Array | None = None
    joint_damping: Array | None = None
    motor_strength: Array | None = None
    kp: Array | None = None
    kd: Array | None = None
    battery: Array | None = None
    action_delay_s: Array | None = None
    observation_delay_s: Array | None = None
    encoder_bias: Array | None = None
    gyro_bias: Array | None = None
    gravity_bias: Array | None = None


SCALES = frozenset(
    ["link_mass", "inertia", "armature", "joint_friction", "motor_strength", "kp", "kd", "battery"]
)  # fields whose nominal value is 1; friction has the robot's own, the others 0


def narrowed(sample: Sample, width: Array | float, friction: float) -> Sample:
    """The sampled robot moved towards the nominal one.

    Args:
        sample: a draw.
        width: 1 leaves it as it is, 0 makes it nominal.
        friction: nominal coefficient of the feet on the ground.
    """
    nominal = {"friction": friction} | dict.fromkeys(SCALES, 1.0)
    moved = {
        name: nominal.get(name, 0.0) + width * (value - nominal.get(name, 0.0))
        for name, value in sample._asdict().items()
        if value is not None
    }
    return sample._replace(**moved)


def _times(nominal: Array, scale: Array | None) -> Array:
    return nominal if scale is None else nominal * scale


def randomised_motor(motor: Motor, sample: Sample) -> Motor:
    """The motors of the sampled robot, from the nominal ones."""
    damping = motor.damping
    if sample.joint_damping is not None:
        damping = damping + sample.joint_damping
    return motor._replace(
        stall_torque=_times(motor.stall_torque, sample.battery),
        no_load_speed=_times(motor.no_load_speed, sample.battery),
        friction=_times(motor.friction, sample.joint_friction),
        damping=damping,
        strength=_times(motor.strength, sample.motor_strength),
    )


def randomised_command(command: JointCommand, sample: Sample) -> JointCommand:
    """The command as the sampled robot's motors carry it out: their true stiffness and damping."""
    return command._replace(kp=_times(command.kp, sample.kp), kd=_times(command.kd, sample.kd))
