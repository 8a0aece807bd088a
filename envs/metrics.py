"""Metrics of a training step besides the rewards."""

import jax
import jax.numpy as jnp

from footfall.envs.terms.data import StepData


def tracking_metrics(data: StepData) -> dict[str, jax.Array]:
    """Tracking errors of a step, and whether the robot fell."""
    velocity = jnp.concatenate([data.linear_velocity[:2], data.angular_velocity[2:]])
    error = data.command - velocity
    return {
        "tracking/linear_error_m_s": jnp.sqrt(jnp.sum(error[:2] ** 2)),
        "tracking/yaw_error_rad_s": jnp.abs(error[2]),
        "episode/falls": data.fell,
    }
