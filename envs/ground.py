"""The ground: flat, at the world's z = 0."""

from typing import Any

import jax

Array = Any  # a NumPy or a JAX array
CONTACT_CLEARANCE_M = 0.002  # a foot closer to the ground counts as touching


def ground_height(place: Array) -> Array:
    """Height of the ground below or above places (..., 3), in the world, m, (...)."""
    return place.__array_namespace__().zeros_like(place[..., 2])


def height_above_ground(place: Array) -> Array:
    """Height of places (..., 3) in the world above the ground below them, m, (...)."""
    return place[..., 2] - ground_height(place)


def in_contact(clearance: jax.Array) -> jax.Array:
    """1.0 where a foot with this clearance (...), m, touches the ground."""
    return (clearance < CONTACT_CLEARANCE_M).astype(clearance.dtype)
