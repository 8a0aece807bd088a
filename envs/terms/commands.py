"""Command terms: how a velocity command is drawn."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from footfall.envs.config import CommandConfig


class CommandTerm(NamedTuple):
    """The declaration of a command term."""

    numbers: int  # uniform numbers that a draw takes
    draw: Callable[..., jax.Array]  # from uniform numbers and the configuration to a command (3,)


def command_term(numbers: int) -> Callable[[Callable[..., jax.Array]], CommandTerm]:
    """Decorator of a function that draws a command from `numbers` uniform numbers."""
    return lambda draw: CommandTerm(numbers, draw)


@command_term(numbers=6)
def velocity(u: jax.Array, config: CommandConfig) -> jax.Array:
    """Uniform in the ranges; some commands ask to stand still, some to move along one axis only.

    Both are rare in a uniform draw, and users command both most often.

    Args:
        u: uniform numbers in [0, 1), shape (6,).
        config: ranges and probabilities.

    Returns:
        Forward m/s, leftward m/s, yaw rad/s, shape (3,).
    """
    ranges = jnp.array([config.ranges.forward_m_s, config.ranges.leftward_m_s, config.ranges.yaw_rad_s])
    command = ranges[:, 0] + (ranges[:, 1] - ranges[:, 0]) * u[:3]
    axis = jax.nn.one_hot(jnp.int32(3 * u[3]), 3)
    command = jnp.where(u[4] < config.single_axis_probability, command * axis, command)
    return jnp.where(u[5] < config.standing_probability, 0.0, command)


COMMANDS: dict[str, CommandTerm] = {"velocity": velocity}
