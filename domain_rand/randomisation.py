"""The quantities that may differ between robots, and their ranges."""

from dataclasses import dataclass, fields
from pathlib import Path

from footfall.common.config import load, read_yaml, structure, with_changes
from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.quantity import (
    OFFSET,
    SCALE,
    Direction,
    Quantity,
    adds_to,
    adds_to_base,
    check_quantity,
    quantity,
    scales,
    scales_bodies,
    scales_joints,
    sets_sliding_friction,
)
from footfall.robots import kinds
from footfall.robots.description import Robot

FULL = 1.0  # charge of a nominal battery
DEFAULT = Path(__file__).parent / "default.yaml"
OWN_FILE = "randomisation.yaml"  # in a robot's folder: ranges that suit this robot only


@dataclass(frozen=True)
class Randomisation:
    """Ranges of the quantities that differ between episodes. An absent field keeps its nominal value.

    Each field declares a quantity: its range and its effect.

    Raises:
        ValueError: a range exceeds the limits of its quantity.
    """

    # body
    friction: Distribution | None = quantity(  # foot on ground, coefficient
        kinds.SCALAR, nominal=None, lower=0.0, upper=10.0, model=sets_sliding_friction()
    )
    link_mass: Distribution | None = quantity(  # of each body, and inertia with it
        kinds.BODY_AMOUNTS, SCALE, lower=0.01, upper=100.0, model=scales_bodies("body_mass", "body_inertia")
    )
    payload_kg: Distribution | None = quantity(  # a point mass at the base's centre of mass
        kinds.SCALAR, OFFSET, lower=-1000.0, upper=1000.0, model=adds_to_base("body_mass")
    )
    com_offset_m: Distribution | None = quantity(  # of the base, each axis
        kinds.VECTOR, OFFSET, lower=-1.0, upper=1.0, model=adds_to_base("body_ipos")
    )
    inertia: Distribution | None = quantity(  # of each body, beyond its mass
        kinds.BODY_AMOUNTS, SCALE, lower=0.01, upper=100.0, model=scales_bodies("body_inertia")
    )
    armature: Distribution | None = quantity(  # reflected inertia, each joint
        kinds.JOINT_AMOUNTS, SCALE, lower=0.0, upper=100.0, model=scales_joints("dof_armature")
    )
    # motors, each joint
    joint_friction: Distribution | None = quantity(
        kinds.JOINT_AMOUNTS, SCALE, lower=0.0, upper=100.0, motor=scales("friction")
    )
    joint_damping: Distribution | None = quantity(  # viscous, N m s/rad
        kinds.JOINT_AMOUNTS, OFFSET, lower=0.0, upper=100.0, motor=adds_to("damping")
    )
    motor_strength: Distribution | None = quantity(  # delivered over commanded torque
        kinds.JOINT_AMOUNTS, SCALE, lower=0.0, upper=10.0, motor=scales("strength")
    )
    kp: Distribution | None = quantity(
        kinds.JOINT_AMOUNTS, SCALE, lower=0.0, upper=10.0, command=scales("kp")
    )
    kd: Distribution | None = quantity(
        kinds.JOINT_AMOUNTS, SCALE, lower=0.0, upper=10.0, command=scales("kd")
    )
    battery: Distribution | None = quantity(  # supply voltage of all joints' motors over the nominal one
        kinds.SCALAR,
        SCALE,
        lower=0.0,
        upper=10.0,
        motor=scales("stall_torque", "no_load_speed", "voltage_gain"),
    )
    # timing
    action_delay_s: Distribution | None = quantity(
        kinds.SCALAR, OFFSET, lower=0.0, upper=1.0, actions=adds_to("delay_s")
    )
    observation_delay_s: Distribution | None = quantity(
        kinds.SCALAR, OFFSET, lower=0.0, upper=1.0, readings=adds_to("delay_s")
    )
    # sensors
    encoder_bias: Distribution | None = quantity(  # rad, each joint
        kinds.JOINTS, OFFSET, lower=-1.0, upper=1.0, bias_of="joint_position"
    )
    gyro_bias: Distribution | None = quantity(  # rad/s, each axis
        kinds.ROTATION, OFFSET, lower=-10.0, upper=10.0, bias_of="gyro"
    )
    gravity_bias: Distribution | None = quantity(  # of a direction of length 1, each axis
        kinds.VECTOR, OFFSET, lower=-1.0, upper=1.0, bias_of="gravity"
    )

    # motors, each joint: effects that a nominal motor may not have
    torque_lag_s: Distribution | None = quantity(  # time constant of the torque, beyond robot.yaml's
        kinds.JOINT_AMOUNTS, OFFSET, lower=0.0, upper=0.1, motor=adds_to("lag_s")
    )
    stribeck_friction: Distribution | None = quantity(  # N m at rest, beyond robot.yaml's
        kinds.JOINT_AMOUNTS, OFFSET, lower=0.0, upper=100.0, motor=adds_to("stribeck")
    )
    load_friction: Distribution | None = quantity(  # share of the motor torque, beyond robot.yaml's
        kinds.JOINT_AMOUNTS, OFFSET, lower=0.0, upper=0.9, motor=adds_to("load_friction")
    )
    backlash_rad: Distribution | None = quantity(  # whole play of the gearbox, beyond robot.yaml's
        kinds.JOINT_AMOUNTS, OFFSET, lower=0.0, upper=0.5, motor=adds_to("backlash")
    )
    gear_compliance: Distribution | None = quantity(  # rad/(N m), beyond robot.yaml's
        kinds.JOINT_AMOUNTS, OFFSET, lower=0.0, upper=1.0, motor=adds_to("compliance")
    )

    battery_charge: Distribution | None = quantity(  # of robot.yaml's battery, whose voltage sags under load
        kinds.SCALAR, FULL, lower=0.0, upper=1.0, charge=True
    )

    # temperature of motors whose thermal model robot.yaml declares
    ambient_k: Distribution | None = quantity(  # of the air, beyond 25 degrees Celsius
        kinds.SCALAR, OFFSET, lower=-100.0, upper=100.0, winding=adds_to("ambient")
    )
    winding_rise_k: Distribution | None = quantity(  # initial temperature above that of the air, each joint
        kinds.JOINT_AMOUNTS, OFFSET, lower=0.0, upper=200.0, winding=adds_to("start_rise")
    )
    winding_heating: Distribution | None = quantity(  # thermal resistance times copper loss, each joint
        kinds.JOINT_AMOUNTS, SCALE, lower=0.0, upper=10.0, winding=scales("heating")
    )
    # force sensors at the feet, each; for the simulated robot alone, since no learned policy reads them
    foot_force_scale: Distribution | None = quantity(
        kinds.FOOT_AMOUNTS, SCALE, lower=0.0, upper=10.0, force_sensor=scales("scale")
    )
    foot_force_offset_n: Distribution | None = quantity(
        kinds.FOOT_AMOUNTS, OFFSET, lower=-1000.0, upper=1000.0, force_sensor=adds_to("offset")
    )
    foot_force_noise_n: Distribution | None = quantity(  # half-width, of each sample
        kinds.FOOT_AMOUNTS, OFFSET, lower=0.0, upper=1000.0, force_sensor=adds_to("noise")
    )

    # the IMU's accelerometer; for the simulated robot alone, since no learned policy reads it
    accelerometer_bias_m_s2: Distribution | None = quantity(  # along each axis
        kinds.VECTOR, OFFSET, lower=-10.0, upper=10.0, accelerometer=adds_to("bias")
    )
    accelerometer_noise_m_s2: Distribution | None = quantity(  # half-width, of each sample
        kinds.SCALAR, OFFSET, lower=0.0, upper=100.0, accelerometer=adds_to("noise")
    )

    # timing that changes within an episode, see domain_rand/transport.py
    action_jitter_s: Distribution | None = quantity(  # largest extra delay, drawn for each command
        kinds.SCALAR, OFFSET, lower=0.0, upper=1.0, actions=adds_to("jitter_s")
    )
    observation_jitter_s: Distribution | None = quantity(
        kinds.SCALAR, OFFSET, lower=0.0, upper=1.0, readings=adds_to("jitter_s")
    )
    action_swing_s: Distribution | None = quantity(  # amplitude of the delay's rise and fall, period 4 s
        kinds.SCALAR, OFFSET, lower=0.0, upper=1.0, actions=adds_to("swing_s")
    )
    observation_swing_s: Distribution | None = quantity(
        kinds.SCALAR, OFFSET, lower=0.0, upper=1.0, readings=adds_to("swing_s")
    )
    lost_commands: Distribution | None = quantity(  # share of the frames to each motor
        kinds.SCALAR, OFFSET, lower=0.0, upper=0.9, actions=adds_to("lost")
    )
    lost_replies: Distribution | None = quantity(  # share of the frames of each motor and of the IMU
        kinds.SCALAR, OFFSET, lower=0.0, upper=0.9, readings=adds_to("lost")
    )

    def __post_init__(self) -> None:
        for each in fields(self):
            drawn, declared = getattr(self, each.name), each.metadata["declares"]
            if drawn is not None and not declared.lower <= drawn.low <= drawn.high <= declared.upper:
                raise ValueError(
                    f"{each.name} must be from {declared.lower:g} to {declared.upper:g},"
                    f" not {drawn.low:g} to {drawn.high:g}"
                )


def declared_quantities(cls: type[Randomisation]) -> dict[str, Quantity]:
    """The quantities that a class declares, by name.

    Raises:
        ValueError: a quantity has no effect; the message names it.
    """
    declared = {each.name: each.metadata["declares"] for each in fields(cls)}
    for name, each in declared.items():
        check_quantity(name, each)
    return declared


QUANTITIES: dict[str, Quantity] = declared_quantities(Randomisation)


def require_delays(randomisation: Randomisation, direction: Direction, max_delay_s: float) -> None:
    """Raise UserError, naming the quantity, if actions or readings may be delayed by more than `max_delay_s`.

    Lost frames do not count: the delay until the next frame has no bound.
    """
    effects = {name: getattr(quantity, direction) for name, quantity in QUANTITIES.items()}
    drawn = {
        name: getattr(randomisation, name)
        for name, effect in effects.items()
        if effect is not None and effect.fields != ("lost",)
    }
    longest_s = sum(each.high for each in drawn.values() if each is not None)
    if longest_s > max_delay_s:
        names = " + ".join(name for name, each in drawn.items() if each is not None)
        raise UserError(f"randomisation.{names}: must be at most {max_delay_s:g} s, not {longest_s:g}")


def require_parts(name: str, robot: Robot) -> None:
    """Raise UserError if a robot does not have the part that the quantity `name` belongs to."""
    declared, missing = QUANTITIES[name], ""
    if declared.force_sensor is not None and not robot.foot_sensors:
        missing = "force_bus"
    elif declared.winding is not None and robot.winding is None:
        missing = "thermal_resistance_k_w"
    elif declared.charge and robot.description.battery is None:
        missing = "battery"
    if missing:
        raise UserError(f"randomisation.{name}: robot '{robot.name}' declares no {missing} in robot.yaml")


def affects_policies(name: str) -> bool:
    """Whether a quantity acts on more than a sensor that no learned policy reads."""
    return QUANTITIES[name].force_sensor is None and QUANTITIES[name].accelerometer is None


def refuse_unread_sensors(randomisation: Randomisation) -> None:
    """Raise UserError if training randomises sensors that no learned policy reads."""
    for name in QUANTITIES:
        if not affects_policies(name) and getattr(randomisation, name) is not None:
            raise UserError(
                f"randomisation.{name}: no learned policy reads this sensor; declare it in"
                f" {OWN_FILE} of the robot's folder, for the simulated robot"
            )


def load_randomisation(path: Path = DEFAULT) -> Randomisation:
    """Read a declaration from YAML; raises UserError if it is malformed."""
    return load(path, Randomisation)


def randomisation_of(robot: Robot) -> Randomisation:
    """The randomisation of a robot: the default, changed by the file in the robot's folder.

    Raises:
        UserError: the robot's `randomisation.yaml` is malformed.
    """
    path = robot.folder / OWN_FILE
    if not path.is_file():
        return load_randomisation()
    return structure(with_changes(read_yaml(DEFAULT), path), Randomisation, f"{path} over {DEFAULT}")


def default_ranges() -> dict[str, tuple[float, float]]:
    """Lowest and highest value of each quantity that the default randomises, by name."""
    default = load_randomisation()
    found = {name: getattr(default, name) for name in QUANTITIES}
    return {name: (each.low, each.high) for name, each in found.items() if each is not None}


def own_ranges(robot: Robot) -> dict[str, Distribution | None]:
    """The quantities of `randomisation_of` that differ from the default, by name."""
    own, default = randomisation_of(robot), load_randomisation()
    return {name: getattr(own, name) for name in QUANTITIES if getattr(own, name) != getattr(default, name)}
