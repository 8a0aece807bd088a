"""brax's networks, built from NumPy's zeros.

Reason: building a network, brax makes arrays of zeros with jax.numpy, of which only the shapes matter. JAX
compiles a program for each shape, before a training can start. Upstream: no report of it was found. Remove
this module when brax makes no such arrays any more; tests/envs/test_workarounds.py fails for a release that
was not tried.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from brax.training import networks


@contextmanager
def numpy_zeros() -> Iterator[None]:
    """Let brax build networks from NumPy's zeros while the context is open."""
    original, networks.jnp = networks.jnp, np
    try:
        yield
    finally:
        networks.jnp = original
