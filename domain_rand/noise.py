"""Noise on readings: fresh at each control step."""

from dataclasses import dataclass
from typing import Any

from footfall.domain_rand.sample import Sample
from footfall.robots.readings import Readings

Array = Any


@dataclass(frozen=True)
class Noise:
    """Half-widths of uniform noise on the readings."""

    joint_position: float = 0.0  # rad
    joint_velocity: float = 0.0  # rad/s
    gyro: float = 0.0  # rad/s
    gravity: float = 0.0  # on each component of the unit vector


def noisy(readings: Readings, noise: Noise, u: Array) -> Readings:
    """Readings with noise, from uniform numbers u in [0, 1) of shape (..., 6 + 2 n).

    Gravity keeps its unit length, as that of a robot's attitude filter does.
    """
    n = readings.joint_position.shape[-1]
    signed = 2.0 * u - 1.0
    return Readings(
        gyro=readings.gyro + noise.gyro * signed[..., :3],
        gravity=_unit(readings.gravity + noise.gravity * signed[..., 3:6]),
        joint_position=readings.joint_position + noise.joint_position * signed[..., 6 : 6 + n],
        joint_velocity=readings.joint_velocity + noise.joint_velocity * signed[..., 6 + n : 6 + 2 * n],
    )


def biased(readings: Readings, sample: Sample) -> Readings:
    """Readings with the sampled robot's sensor biases; the gravity vector is normalised again."""
    gyro, gravity, position, velocity = readings
    if sample.gyro_bias is not None:
        gyro = gyro + sample.gyro_bias
    if sample.gravity_bias is not None:
        gravity = _unit(gravity + sample.gravity_bias)
    if sample.encoder_bias is not None:
        position = position + sample.encoder_bias
    return Readings(gyro, gravity, position, velocity)


def _unit(vector: Array) -> Array:
    xp = vector.__array_namespace__()
    return vector / xp.sqrt(xp.sum(vector * vector, axis=-1, keepdims=True))
