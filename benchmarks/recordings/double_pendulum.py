"""A planar double pendulum with geared motors: base parameters, and its motion in many windows at once."""

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

from footfall.identify.shooting import Number
from footfall.robots.actuator import Motor, friction_torque

STEP_S = 0.001

# M11 = inertia_1 + 2 coupling cos q2, M12 = inertia_12 + coupling cos q2, M22 = inertia_2; gravity:
# gravity_1 sin q1 + gravity_2 sin(q1 + q2) and gravity_2 sin(q1 + q2). Friction by robots/actuator.py.
BASE = (
    Number("inertia_1", "kg m^2", 0.12, 0.02, 0.5, 0.02),
    Number("inertia_12", "kg m^2", 0.02, 0.0, 0.2, 0.01),
    Number("inertia_2", "kg m^2", 0.03, 0.002, 0.2, 0.01),
    Number("coupling", "kg m^2", 0.03, 0.0, 0.2, 0.01),
    Number("gravity_1", "N m", 3.0, 0.5, 10.0, 0.3),
    Number("gravity_2", "N m", 1.0, 0.1, 5.0, 0.1),
    Number("coulomb_1", "N m", 0.1, 0.0, 1.0, 0.05),
    Number("coulomb_2", "N m", 0.1, 0.0, 1.0, 0.05),
    Number("viscous_1", "N m s/rad", 0.01, 0.0, 0.3, 0.01),
    Number("viscous_2", "N m s/rad", 0.01, 0.0, 0.3, 0.01),
)
EFFECTS = (
    Number("load_friction_1", "", 0.05, 0.0, 0.4, 0.05),
    Number("load_friction_2", "", 0.05, 0.0, 0.4, 0.05),
    Number("stribeck_1", "N m", 0.02, 0.0, 0.5, 0.05),
    Number("stribeck_2", "N m", 0.02, 0.0, 0.5, 0.05),
    Number("delay_1", "s", 0.001, 0.0, 0.04, 0.004),
    Number("delay_2", "s", 0.001, 0.0, 0.04, 0.004),
    Number("strength_2", "", 1.0, 0.7, 1.3, 0.05),
)
GRAVITY = 9.81
RAMP_RAD_S = 0.05  # speed at which Coulomb friction is fully developed
STRIBECK_RAD_S = 0.5


def accelerate(value: Mapping[str, Any], state: jnp.ndarray, drive: jnp.ndarray) -> jnp.ndarray:
    """Accelerations, rad/s^2, (2,).

    Args:
        value: numbers by name.
        state: q1, q2, v1, v2.
        drive: torques of the motors, N m, (2,).
    """
    q, v = state[:2], state[2:]
    tau = drive + friction_torque(v, _motor(value), drive)
    coriolis = value["coupling"] * jnp.sin(q[1])
    weight_2 = value["gravity_2"] * jnp.sin(q[0] + q[1])
    rhs_1 = tau[0] + coriolis * (2.0 * v[0] + v[1]) * v[1] - value["gravity_1"] * jnp.sin(q[0]) - weight_2
    rhs_2 = tau[1] - coriolis * v[0] ** 2 - weight_2
    m11 = value["inertia_1"] + 2.0 * value["coupling"] * jnp.cos(q[1])
    m12 = value["inertia_12"] + value["coupling"] * jnp.cos(q[1])
    m22 = value["inertia_2"]
    determinant = jnp.maximum(m11 * m22 - m12 * m12, 1e-5)
    return jnp.stack([m22 * rhs_1 - m12 * rhs_2, m11 * rhs_2 - m12 * rhs_1]) / determinant


def _motor(value: Mapping[str, Any]) -> Motor:
    """Losses of both motors; without limits, because their torque is recorded."""
    free = jnp.array(jnp.inf)

    def pair(name: str) -> jnp.ndarray:
        return jnp.stack([jnp.asarray(value.get(f"{name}_{joint}", 0.0)) for joint in (1, 2)])

    return Motor(
        peak_torque=free,
        stall_torque=free,
        no_load_speed=free,
        friction=pair("coulomb"),
        friction_speed=value.get("ramp", RAMP_RAD_S),
        damping=pair("viscous"),
        strength=jnp.array(1.0),
        stribeck=pair("stribeck"),
        stribeck_speed=STRIBECK_RAD_S,
        load_friction=pair("load_friction"),
    )
