"""Uniform numbers for a whole step at once: one large draw costs less than many."""

import jax
import jax.numpy as jnp
import numpy as np


def uniform(key: jax.Array, *sizes: int) -> list[jax.Array]:
    """Independent numbers in [0, 1), in vectors of these sizes.

    The numbers are computed apart from their uses. Otherwise XLA fuses twenty rounds of a hash into each use,
    which takes a third of a program's compilation.
    """
    return split(jax.lax.optimization_barrier(jax.random.uniform(key, (sum(sizes),))), *sizes)


def split(vector: jax.Array, *sizes: int) -> list[jax.Array]:
    """A vector cut into vectors of these sizes."""
    return jnp.split(vector, np.cumsum(sizes)[:-1])
