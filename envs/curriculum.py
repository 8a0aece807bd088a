"""The curriculum: how hard the task is after how much training."""

import jax
import jax.numpy as jnp

from footfall.envs.config import Curriculum


def level_after(steps: jax.Array, curriculum: Curriculum) -> jax.Array:
    """The level after so many environment steps in all, 0 to 1."""
    ramp = curriculum.steps
    return jnp.ones_like(steps) if ramp == 0 else jnp.minimum(steps / ramp, 1.0)


def share(start: float, level: jax.Array | float) -> jax.Array | float:
    """What grows linearly from `start` at level 0 to 1 at level 1."""
    return start + (1 - start) * level
