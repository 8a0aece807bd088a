"""Errors of the IMU's accelerometer. `Randomisation` declares their ranges."""

from typing import Any, NamedTuple

from footfall.domain_rand.sample import Sample, changed

Array = Any  # a NumPy or a JAX array


class Accelerometer(NamedTuple):
    """Errors of a robot's accelerometer; by default none."""

    bias: Array = 0.0  # m/s^2, along each axis
    noise: Array = 0.0  # m/s^2, half-width of the uniform noise of each sample


def randomised_accelerometer(sample: Sample) -> Accelerometer:
    """The accelerometer of the sampled robot."""
    return changed(Accelerometer(), sample, "accelerometer")
