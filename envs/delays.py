"""Delays in continuous time between control steps, at the resolution of the physics."""

import jax
import jax.numpy as jnp


def delayed_goal(
    goals: jax.Array, delay_s: jax.Array | None, since_step_s: jax.Array, period_s: float
) -> jax.Array:
    """The joint target that has reached the motors.

    Args:
        goals: targets of the last control steps, newest first, shape (k, n).
        delay_s: action delay, at most (k - 1) control periods; None for none.
        since_step_s: time since the newest target was computed.
        period_s: control period.
    """
    if delay_s is None:
        return goals[0]
    lag = jnp.ceil((delay_s - since_step_s) / period_s - 1e-6)
    return goals[jnp.clip(lag, 0, goals.shape[0] - 1).astype(jnp.int32)]


def delayed_readings(trail: jax.Array, delay_s: jax.Array | None, timestep_s: float) -> jax.Array:
    """Readings as they were `delay_s` ago, by linear interpolation between physics steps.

    Args:
        trail: readings after each of the last physics steps, oldest first, shape (k, m).
        delay_s: observation delay, at most (k - 1) physics steps; None for none.
        timestep_s: physics step.
    """
    if delay_s is None:
        return trail[-1]
    place = jnp.clip(trail.shape[0] - 1 - delay_s / timestep_s, 0.0, trail.shape[0] - 1.0)
    before = jnp.floor(place).astype(jnp.int32)
    after = jnp.minimum(before + 1, trail.shape[0] - 1)
    share = place - before
    return (1.0 - share) * trail[before] + share * trail[after]
