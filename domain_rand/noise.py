"""Bias and noise on readings, for NumPy and JAX arrays. `Noise` declares them (robots/readings.py)."""

from typing import Any

from footfall.common.rotations import normalised
from footfall.domain_rand.sample import Sample, sensor_bias
from footfall.robots.readings import READINGS, Noise, Readings, from_vector

__all__ = ["Noise", "biased", "noisy"]

Array = Any


def biased(readings: Readings, sample: Sample) -> Readings:
    """Readings with the sampled robot's sensor biases."""
    biases = {name: sensor_bias(sample, name) for name in READINGS}
    return {
        name: value if biases[name] is None else _shifted(name, value, biases[name])
        for name, value in readings.items()
    }


def noisy(readings: Readings, noise: Noise, u: Array) -> Readings:
    """Readings with noise, from uniform numbers u in [0, 1) of shape (..., readings_size)."""
    signed = from_vector(2.0 * u - 1.0, readings["joint_position"].shape[-1])
    return {
        name: _shifted(name, value, getattr(noise, name) * signed[name]) for name, value in readings.items()
    }


def _shifted(name: str, value: Array, offset: Array) -> Array:
    """A reading plus an offset; a direction is normalised again, as by an attitude filter."""
    shifted = value + offset
    return normalised(shifted) if READINGS[name].unit_length else shifted
