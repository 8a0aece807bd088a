"""The ground: flat, at the world's z = 0."""

from typing import Any

import jax

Array = Any  # a NumPy or a JAX array
CONTACT_CLEARANCE_M = 0.002  # a foot closer to the ground counts as touching


def ground_height(position: Array) -> Array:
    """Height of the ground below or above positions (..., 3), in the world, m, (...)."""
    return position.__array_namespace__().zeros_like(position[..., 2])


def height_above_ground(position: Array) -> Array:
    """Height of positions (..., 3) in the world above the ground below them, m, (...)."""
    return position[..., 2] - ground_height(position)


def in_contact(clearance: jax.Array) -> jax.Array:
    """1.0 where a foot with this clearance (...), m, touches the ground."""
    return (clearance < CONTACT_CLEARANCE_M).astype(clearance.dtype)
