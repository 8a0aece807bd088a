"""A pendulum moved by a hobby servo: the joint law's voltage-driven motor, and the published law."""

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

from footfall.identify.shooting import Number
from footfall.robots.actuator import JointCommand, Motor, friction_torque, joint_damping, motor_torque

GRAVITY = 9.81
STEP_S = 0.001
RAMP_RAD_S = 0.01  # speed at which dry friction is fully developed

NUMBERS = (
    Number("kt", "N m/A", 0.35, 0.1, 3.0, 0.05),
    Number("resistance", "ohm", 4.0, 0.5, 12.0, 0.5),
    Number("duty_resistance", "", 0.2, 0.0, 2.0, 0.2),
    Number("armature", "kg m^2", 0.002, 0.0002, 0.1, 0.0005),
    Number("coulomb", "N m", 0.012, 0.0, 0.5, 0.005),
    Number("viscous", "N m s/rad", 0.005, 0.0, 0.5, 0.003),
    Number("stribeck", "N m", 0.005, 0.0, 0.5, 0.005),
    Number("stribeck_speed", "rad/s", 0.3, 0.02, 3.0, 0.2),
    Number("load_friction", "", 0.1, 0.0, 0.6, 0.05),
    Number("delay", "s", 0.005, 0.0, 0.035, 0.003),
    Number("offset", "rad", 0.0, -0.1, 0.1, 0.01),
)
PLAIN = ("kt", "resistance", "armature", "coulomb", "viscous", "offset")  # parameters of the published M1
LAW = tuple(each.name for each in NUMBERS)  # parameters of the joint law


def motor_of(value: Mapping[str, Any], supply: Any) -> Motor:
    """The servo as a motor of the joint law; `supply` in V."""
    return Motor(
        peak_torque=jnp.array(jnp.inf),
        stall_torque=value["kt"] * supply / value["resistance"],
        no_load_speed=supply / value["kt"],
        friction=value["coulomb"],
        friction_speed=RAMP_RAD_S,
        damping=value["viscous"],
        strength=jnp.ones(()),
        stribeck=value.get("stribeck", 0.0),
        stribeck_speed=value.get("stribeck_speed", 1.0),
        load_friction=value.get("load_friction", 0.0),
        voltage_gain=jnp.ones(()),
        duty_resistance=value.get("duty_resistance", 0.0),
    )


def accelerate(
    value: Mapping[str, Any], state: jnp.ndarray, inputs: jnp.ndarray, both_sides: bool = False
) -> jnp.ndarray:
    """Acceleration, rad/s^2, (1,), over a linearly implicit step as in the environments.

    Args:
        value: numbers by name.
        state: position and velocity.
        inputs: goal, rad; 1 with torque enabled; duty per rad; mass, kg; length, m; supply, V.
        both_sides: load of the gearbox is the larger of motor torque and weight, which the joint law lacks.
    """
    q, v = state
    goal, enabled, gain, mass, length, supply = inputs
    motor, zero = motor_of(value, supply), jnp.zeros(())
    command = JointCommand(goal, zero, gain * motor.stall_torque, zero, zero)
    drive = enabled * motor_torque(command, q, v, motor)
    weight = mass * GRAVITY * length * jnp.sin(q + value["offset"])
    load = jnp.maximum(jnp.abs(drive), jnp.abs(weight)) if both_sides else drive
    released = JointCommand(zero, zero, zero, zero, zero), motor._replace(voltage_gain=zero)
    damping = jnp.where(
        enabled > 0.5, joint_damping(command, q, v, motor), joint_damping(released[0], q, v, released[1])
    )
    inertia = mass * length**2 + value["armature"] + STEP_S * damping
    return ((drive + friction_torque(v, motor, load) - weight) / inertia)[None]


def accelerate_both_sides(value: Mapping[str, Any], state: jnp.ndarray, inputs: jnp.ndarray) -> jnp.ndarray:
    """`accelerate` with friction from both sides of the gearbox."""
    return accelerate(value, state, inputs, both_sides=True)


def accelerate_makers(value: Mapping[str, Any], state: jnp.ndarray, inputs: jnp.ndarray) -> jnp.ndarray:
    """Law of Duclusaud et al. (arXiv 2410.08650), models M1 and M4: friction that stops the joint.

    The friction is at most b + l |weight - motor| + exp(-|v / v_s|^a) (b_s + l_s |weight - motor|) + viscous
    |v|.
    """
    q, v = state
    goal, enabled, gain, mass, length, supply = inputs
    duty = jnp.clip(gain * (goal - q), -1.0, 1.0)
    drive = enabled * value["kt"] / value["resistance"] * (supply * duty - value["kt"] * v)
    weight = -mass * GRAVITY * length * jnp.sin(q + value["offset"])
    load = jnp.abs(weight - drive)
    stribeck_share = jnp.exp(-(jnp.abs(v / value["stribeck_speed"]) ** value["alpha"]))
    max_friction = value["coulomb"] + value["load_friction"] * load + value["viscous"] * jnp.abs(v)
    max_friction = max_friction + stribeck_share * (value["stribeck"] + value["load_stribeck"] * load)
    inertia = mass * length**2 + value["armature"]
    stopping_torque = inertia / STEP_S * v + drive + weight
    return ((drive + weight - jnp.clip(stopping_torque, -max_friction, max_friction)) / inertia)[None]
