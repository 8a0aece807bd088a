"""Curriculum terms: the share of the full difficulty at a level of the curriculum.

The level rises linearly from 0 to 1 over `curriculum_steps` environment steps. A term turns it into the share
that multiplies the command, an event's strength, or the distance of each robot from the nominal one.
"""

from collections.abc import Callable
from typing import Annotated

import jax

from footfall.common.terms import Between


def linear(level: jax.Array | float, *, start: Annotated[float, Between(0.0, 1.0)]) -> jax.Array | float:
    """Rises linearly from `start` at level 0 to 1 at level 1."""
    return start + (1 - start) * level


CURRICULA: dict[str, Callable[..., jax.Array | float]] = {"linear": linear}
