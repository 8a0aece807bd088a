"""Uniform numbers for a whole step at once: one large draw costs less than many."""

import jax
import jax.numpy as jnp
import numpy as np


def uniform(key: jax.Array, *sizes: int) -> list[jax.Array]:
    """Independent numbers in [0, 1), in vectors of these sizes."""
    return split(jax.random.uniform(key, (sum(sizes),)), *sizes)


def split(vector: jax.Array, *sizes: int) -> list[jax.Array]:
    """A vector cut into vectors of these sizes."""
    return jnp.split(vector, np.cumsum(sizes)[:-1])
