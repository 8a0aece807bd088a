"""brax's networks, built from NumPy's zeros."""

import numpy as np
from brax.training import networks

from footfall.train.brax.numpy_zeros import numpy_zeros


def test_jaxs_functions_are_restored() -> None:
    before = networks.jnp
    with numpy_zeros():
        assert networks.jnp is np
    assert networks.jnp is before
