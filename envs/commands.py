"""Velocity commands: drawn, held for a while, drawn again."""

import jax
import jax.numpy as jnp

from footfall.envs.config import CommandConfig

COMMAND_NUMBERS = 6


def draw_command(u: jax.Array, config: CommandConfig) -> jax.Array:
    """The command (forward m/s, leftward m/s, yaw rad/s), shape (3,), of uniform numbers u in [0, 1).

    Some ask to stand still, some to move along one axis only: both are rare in a uniform draw, and both
    are what users ask for most.

    Args:
        u: shape (COMMAND_NUMBERS,).
    """
    ranges = jnp.array([config.ranges.forward_m_s, config.ranges.leftward_m_s, config.ranges.yaw_rad_s])
    command = ranges[:, 0] + (ranges[:, 1] - ranges[:, 0]) * u[:3]
    axis = jax.nn.one_hot(jnp.int32(3 * u[3]), 3)
    command = jnp.where(u[4] < config.single_axis_probability, command * axis, command)
    return jnp.where(u[5] < config.standing_probability, 0.0, command)


def draw_hold_steps(u: jax.Array, config: CommandConfig, control_rate_hz: float) -> jax.Array:
    """Control steps for which a command is held, int32, of a uniform number u in [0, 1)."""
    return jnp.int32(config.hold_s.quantile(u) * control_rate_hz)
