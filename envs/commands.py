"""Velocity commands: drawn, held for a while, drawn again."""

import jax
import jax.numpy as jnp

from envs.config import CommandConfig


def draw_command(key: jax.Array, config: CommandConfig) -> jax.Array:
    """A command (forward m/s, leftward m/s, yaw rad/s), shape (3,).

    Some ask to stand still, some to move along one axis only: both are rare in a uniform draw, and both
    are what users ask for most.
    """
    value_key, stand_key, single_key, axis_key = jax.random.split(key, 4)
    ranges = jnp.array([config.ranges.forward_m_s, config.ranges.leftward_m_s, config.ranges.yaw_rad_s])
    command = jax.random.uniform(value_key, (3,), minval=ranges[:, 0], maxval=ranges[:, 1])
    axis = jax.nn.one_hot(jax.random.randint(axis_key, (), 0, 3), 3)
    single = jax.random.bernoulli(single_key, config.single_axis_probability)
    standing = jax.random.bernoulli(stand_key, config.standing_probability)
    command = jnp.where(single, command * axis, command)
    return jnp.where(standing, 0.0, command)


def draw_hold_steps(key: jax.Array, config: CommandConfig, control_rate_hz: float) -> jax.Array:
    """Control steps for which a command is held, int32."""
    seconds = config.hold_s.quantile(jax.random.uniform(key))
    return jnp.int32(seconds * control_rate_hz)
