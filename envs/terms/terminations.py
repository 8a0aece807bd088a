"""Termination terms: conditions that end an episode as a failure.

The time limit `episode_s` and a diverged simulation also end an episode, without a term.
"""

from collections.abc import Callable
from typing import Annotated

import jax
import jax.numpy as jnp
import numpy as np

from footfall.common.terms import Between
from footfall.envs.terms.data import StepData


def tilted(data: StepData, *, limit_rad: Annotated[float, Between(1e-3, 3.2)] = 1.1) -> jax.Array:
    """The base is tilted by more than `limit_rad` from upright."""
    return data.gravity[2] > -np.cos(limit_rad)


def sunk(data: StepData, *, min_height_share: Annotated[float, Between(0.0, 1.0)] = 0.55) -> jax.Array:
    """The base is lower than `min_height_share` of the robot's standing height."""
    return data.height < min_height_share * data.scene.standing_height


def base_contact(data: StepData, *, depth_m: Annotated[float, Between(-0.1, 1.0)] = 0.01) -> jax.Array:
    """A point on the base is deeper than `depth_m` in the ground; with a negative depth, nearer to it."""
    return jnp.max(jnp.where(data.scene.body.on_base, data.depth, -jnp.inf)) > depth_m


TERMINATIONS: dict[str, Callable[..., jax.Array]] = {f.__name__: f for f in (tilted, sunk, base_contact)}
