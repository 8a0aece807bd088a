"""brax's networks, built from NumPy's zeros."""

from typing import Any

import numpy as np
import pytest
from brax.training import networks

from footfall.train.brax.numpy_zeros import numpy_zeros


class Recorder:
    """Stands for jax.numpy; counts arrays of zeros."""

    made = 0

    def zeros(self, shape: Any) -> np.ndarray:
        self.made += 1
        return np.zeros(shape)


def test_brax_builds_networks_from_jaxs_zeros(monkeypatch: pytest.MonkeyPatch) -> None:
    """If this fails, footfall/train/brax/numpy_zeros.py can be deleted."""
    recorder = Recorder()
    monkeypatch.setattr(networks, "jnp", recorder)
    networks.make_value_network({"state": (3,)}, obs_key="state")
    assert recorder.made


def test_jax_is_restored() -> None:
    before = networks.jnp
    with numpy_zeros():
        assert networks.jnp is np
    assert networks.jnp is before
