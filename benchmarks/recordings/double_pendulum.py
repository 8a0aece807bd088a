"""A planar double pendulum with geared motors: its base parameters and accelerations."""

from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

from footfall.identify.shooting import FitParameter
from footfall.robots.actuator import Motor, friction_torque

STEP_S = 0.001

# M11 = inertia_1 + 2 coupling cos q2, M12 = inertia_12 + coupling cos q2, M22 = inertia_2; gravity:
# gravity_1 sin q1 + gravity_2 sin(q1 + q2) and gravity_2 sin(q1 + q2). Friction by robots/actuator.py.
BASE = (
    FitParameter("inertia_1", "kg m^2", 0.12, 0.02, 0.5, 0.02),
    FitParameter("inertia_12", "kg m^2", 0.02, 0.0, 0.2, 0.01),
    FitParameter("inertia_2", "kg m^2", 0.03, 0.002, 0.2, 0.01),
    FitParameter("coupling", "kg m^2", 0.03, 0.0, 0.2, 0.01),
    FitParameter("gravity_1", "N m", 3.0, 0.5, 10.0, 0.3),
    FitParameter("gravity_2", "N m", 1.0, 0.1, 5.0, 0.1),
    FitParameter("coulomb_1", "N m", 0.1, 0.0, 1.0, 0.05),
    FitParameter("coulomb_2", "N m", 0.1, 0.0, 1.0, 0.05),
    FitParameter("viscous_1", "N m s/rad", 0.01, 0.0, 0.3, 0.01),
    FitParameter("viscous_2", "N m s/rad", 0.01, 0.0, 0.3, 0.01),
)
EFFECTS = (
    FitParameter("load_friction_1", "", 0.05, 0.0, 0.4, 0.05),
    FitParameter("load_friction_2", "", 0.05, 0.0, 0.4, 0.05),
    FitParameter("stribeck_1", "N m", 0.02, 0.0, 0.5, 0.05),
    FitParameter("stribeck_2", "N m", 0.02, 0.0, 0.5, 0.05),
    FitParameter("delay_1", "s", 0.001, 0.0, 0.04, 0.004),
    FitParameter("delay_2", "s", 0.001, 0.0, 0.04, 0.004),
    FitParameter("strength_2", "", 1.0, 0.7, 1.3, 0.05),
)
GRAVITY = 9.81
RAMP_RAD_S = 0.05  # speed at which Coulomb friction is fully developed
STRIBECK_RAD_S = 0.5


def acceleration(values: Mapping[str, Any], state: jnp.ndarray, torque: jnp.ndarray) -> jnp.ndarray:
    """Accelerations, rad/s^2, (2,).

    Args:
        values: parameters by name.
        state: q1, q2, v1, v2.
        torque: torques of the motors, N m, (2,).
    """
    q, v = state[:2], state[2:]
    tau = torque + friction_torque(v, _motor(values), torque)
    coriolis = values["coupling"] * jnp.sin(q[1])
    weight_2 = values["gravity_2"] * jnp.sin(q[0] + q[1])
    rhs_1 = tau[0] + coriolis * (2.0 * v[0] + v[1]) * v[1] - values["gravity_1"] * jnp.sin(q[0]) - weight_2
    rhs_2 = tau[1] - coriolis * v[0] ** 2 - weight_2
    m11 = values["inertia_1"] + 2.0 * values["coupling"] * jnp.cos(q[1])
    m12 = values["inertia_12"] + values["coupling"] * jnp.cos(q[1])
    m22 = values["inertia_2"]
    determinant = jnp.maximum(m11 * m22 - m12 * m12, 1e-5)
    return jnp.stack([m22 * rhs_1 - m12 * rhs_2, m11 * rhs_2 - m12 * rhs_1]) / determinant


def _motor(values: Mapping[str, Any]) -> Motor:
    """Losses of both motors; without limits, because their torque is recorded."""
    unlimited = jnp.array(jnp.inf)

    def pair(name: str) -> jnp.ndarray:
        return jnp.stack([jnp.asarray(values.get(f"{name}_{joint}", 0.0)) for joint in (1, 2)])

    return Motor(
        peak_torque=unlimited,
        stall_torque=unlimited,
        no_load_speed=unlimited,
        friction=pair("coulomb"),
        friction_speed=values.get("ramp", RAMP_RAD_S),
        damping=pair("viscous"),
        strength=jnp.array(1.0),
        stribeck=pair("stribeck"),
        stribeck_speed=STRIBECK_RAD_S,
        load_friction=pair("load_friction"),
    )
