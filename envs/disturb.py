"""What changes for the robot from outside during an episode: commands and pushes."""

import jax
import jax.numpy as jnp

from footfall.envs.base import Base
from footfall.envs.commands import COMMAND_NUMBERS, draw_command, draw_hold_steps
from footfall.envs.config import EnvConfig, PushConfig
from footfall.envs.curriculum import share
from footfall.envs.random_numbers import split
from footfall.envs.state import State

PUSH_NUMBERS = 6
DISTURBANCE_NUMBERS = COMMAND_NUMBERS + PUSH_NUMBERS + 2


def disturb(state: State, u: jax.Array, config: EnvConfig, base: Base) -> State:
    """Draw a new command when the old one's time is up, and push when a push is due.

    Args:
        state: after a control step.
        u: uniform numbers, shape (DISTURBANCE_NUMBERS,).
        config: of the environment.
        base: what is pushed.
    """
    command, push, (hold, interval) = split(u, COMMAND_NUMBERS, PUSH_NUMBERS, 2)
    command_due, push_due = state.hold_steps <= 0, state.push_steps <= 0
    hold_steps = draw_hold_steps(hold, config.commands, config.control_rate_hz)
    strength = share(config.curriculum.pushes, state.level)
    change = jnp.where(push_due, strength * draw_push(push, config.pushes), 0.0)
    return state._replace(
        command=jnp.where(command_due, command_at_level(command, config, state.level), state.command),
        hold_steps=jnp.where(command_due, hold_steps, state.hold_steps - 1),
        push_steps=jnp.where(push_due, draw_push_steps(interval, config), state.push_steps - 1),
        qvel=base.pushed(state.qvel, change),
    )


def command_at_level(u: jax.Array, config: EnvConfig, level: jax.Array | float) -> jax.Array:
    """A command (3,) from uniform numbers (COMMAND_NUMBERS,), as large as the curriculum allows."""
    return draw_command(u, config.commands) * share(config.curriculum.commands, level)


def draw_push_steps(u: jax.Array, config: EnvConfig) -> jax.Array:
    """Control steps until the next push, int32, of a uniform number u in [0, 1)."""
    return jnp.int32(config.pushes.interval_s.quantile(u) * config.control_rate_hz)


def draw_push(u: jax.Array, pushes: PushConfig) -> jax.Array:
    """Sudden change of the base's velocity, shape (6,): linear in the world, angular in the body.

    Args:
        u: uniform numbers, shape (PUSH_NUMBERS,).
        pushes: how strong they may be.
    """
    angle, size = 2 * jnp.pi * u[0], pushes.horizontal_m_s * u[1]
    linear = jnp.array([size * jnp.cos(angle), size * jnp.sin(angle), pushes.vertical_m_s * (2 * u[2] - 1)])
    return jnp.concatenate([linear, pushes.angular_rad_s * (2 * u[3:] - 1)])
