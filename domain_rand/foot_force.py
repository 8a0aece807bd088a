"""Errors of force sensors at the feet. `Randomisation` declares their ranges."""

from typing import Any, NamedTuple

import numpy as np

from footfall.domain_rand.sample import Sample, changed

Array = Any  # a NumPy or a JAX array


class ForceSensors(NamedTuple):
    """Errors of a robot's force sensors: arrays that broadcast to (feet,); by default none."""

    scale: Array = 1.0  # reading over force
    offset: Array = 0.0  # N
    noise: Array = 0.0  # N, half-width of the uniform noise of each sample


def randomised_sensors(sample: Sample) -> ForceSensors:
    """The force sensors of the sampled robot."""
    return changed(ForceSensors(), sample, "force_sensor")


def measured(force: np.ndarray, sensors: ForceSensors, u: np.ndarray) -> np.ndarray:
    """Readings of the sensors, N, (feet,), from forces, N, and uniform numbers u in [0, 1), (feet,)."""
    found: np.ndarray = sensors.scale * force + sensors.offset + sensors.noise * (2.0 * u - 1.0)
    return found
