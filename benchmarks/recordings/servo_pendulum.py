"""A pendulum moved by a hobby servo: the joint law's voltage-driven motor, and the published law."""

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

from footfall.identify.shooting import FitParameter
from footfall.robots.actuator import JointCommand, Motor, friction_torque, joint_damping, motor_torque

GRAVITY = 9.81
STEP_S = 0.001
RAMP_RAD_S = 0.01  # speed at which dry friction is fully developed

PARAMETERS = (
    FitParameter("kt", "N m/A", 0.35, 0.1, 3.0, 0.05),
    FitParameter("resistance", "ohm", 4.0, 0.5, 12.0, 0.5),
    FitParameter("duty_resistance", "", 0.2, 0.0, 2.0, 0.2),
    FitParameter("armature", "kg m^2", 0.002, 0.0002, 0.1, 0.0005),
    FitParameter("coulomb", "N m", 0.012, 0.0, 0.5, 0.005),
    FitParameter("viscous", "N m s/rad", 0.005, 0.0, 0.5, 0.003),
    FitParameter("stribeck", "N m", 0.005, 0.0, 0.5, 0.005),
    FitParameter("stribeck_speed", "rad/s", 0.3, 0.02, 3.0, 0.2),
    FitParameter("load_friction", "", 0.1, 0.0, 0.6, 0.05),
    FitParameter("delay", "s", 0.005, 0.0, 0.035, 0.003),
    FitParameter("offset", "rad", 0.0, -0.1, 0.1, 0.01),
)
PLAIN = ("kt", "resistance", "armature", "coulomb", "viscous", "offset")  # parameters of the published M1
LAW = tuple(each.name for each in PARAMETERS)  # parameters of the joint law


def motor_of(values: Mapping[str, Any], supply: Any) -> Motor:
    """The servo as a motor of the joint law; `supply` in V."""
    return Motor(
        peak_torque=jnp.array(jnp.inf),
        stall_torque=values["kt"] * supply / values["resistance"],
        no_load_speed=supply / values["kt"],
        friction=values["coulomb"],
        friction_speed=RAMP_RAD_S,
        damping=values["viscous"],
        strength=jnp.ones(()),
        stribeck=values.get("stribeck", 0.0),
        stribeck_speed=values.get("stribeck_speed", 1.0),
        load_friction=values.get("load_friction", 0.0),
        voltage_gain=jnp.ones(()),
        duty_resistance=values.get("duty_resistance", 0.0),
    )


def acceleration(
    values: Mapping[str, Any], state: jnp.ndarray, inputs: jnp.ndarray, both_sides: bool = False
) -> jnp.ndarray:
    """Acceleration, rad/s^2, (1,), over a linearly implicit step as in the environments.

    Args:
        values: parameters by name.
        state: position and velocity.
        inputs: goal, rad; 1 with torque enabled; duty per rad; mass, kg; length, m; supply, V.
        both_sides: load of the gearbox is the larger of motor torque and weight, which the joint law lacks.
    """
    q, v = state
    goal, enabled, gain, mass, length, supply = inputs
    motor, zero = motor_of(values, supply), jnp.zeros(())
    command = JointCommand(goal, zero, gain * motor.stall_torque, zero, zero)
    drive = enabled * motor_torque(command, q, v, motor)
    weight = mass * GRAVITY * length * jnp.sin(q + values["offset"])
    load = jnp.maximum(jnp.abs(drive), jnp.abs(weight)) if both_sides else drive
    released = JointCommand(zero, zero, zero, zero, zero), motor._replace(voltage_gain=zero)
    damping = jnp.where(
        enabled > 0.5, joint_damping(command, q, v, motor), joint_damping(released[0], q, v, released[1])
    )
    inertia = mass * length**2 + values["armature"] + STEP_S * damping
    return ((drive + friction_torque(v, motor, load) - weight) / inertia)[None]


def acceleration_both_sides(
    values: Mapping[str, Any], state: jnp.ndarray, inputs: jnp.ndarray
) -> jnp.ndarray:
    """`acceleration` with friction from both sides of the gearbox."""
    return acceleration(values, state, inputs, both_sides=True)


def acceleration_published(values: Mapping[str, Any], state: jnp.ndarray, inputs: jnp.ndarray) -> jnp.ndarray:
    """Law of Duclusaud et al. (arXiv 2410.08650), models M1 and M4: friction that stops the joint.

    The friction is at most b + l |weight - motor| + exp(-|v / v_s|^a) (b_s + l_s |weight - motor|) + viscous
    |v|.
    """
    q, v = state
    goal, enabled, gain, mass, length, supply = inputs
    duty = jnp.clip(gain * (goal - q), -1.0, 1.0)
    drive = enabled * values["kt"] / values["resistance"] * (supply * duty - values["kt"] * v)
    weight = -mass * GRAVITY * length * jnp.sin(q + values["offset"])
    load = jnp.abs(weight - drive)
    stribeck_share = jnp.exp(-(jnp.abs(v / values["stribeck_speed"]) ** values["alpha"]))
    max_friction = values["coulomb"] + values["load_friction"] * load + values["viscous"] * jnp.abs(v)
    max_friction = max_friction + stribeck_share * (values["stribeck"] + values["load_stribeck"] * load)
    inertia = mass * length**2 + values["armature"]
    stopping_torque = inertia / STEP_S * v + drive + weight
    return ((drive + weight - jnp.clip(stopping_torque, -max_friction, max_friction)) / inertia)[None]
