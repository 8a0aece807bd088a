"""What a robot senses of itself, as far as a learned policy may know it."""

from typing import Any, NamedTuple

Array = Any  # a NumPy or a JAX array


class Readings(NamedTuple):
    """What the actor may know, shapes (..., k): only what a robot can sense."""

    gyro: Array  # (..., 3) rad/s, body frame
    gravity: Array  # (..., 3) unit vector of gravity in the body frame; (0, 0, -1) when upright
    joint_position: Array  # (..., n) rad
    joint_velocity: Array  # (..., n) rad/s
