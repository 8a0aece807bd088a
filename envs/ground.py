"""The ground: flat, at the world's z = 0."""

import jax

CONTACT_CLEARANCE_M = 0.002  # a foot closer to the ground counts as touching


def height_above_ground(place: jax.Array) -> jax.Array:
    """Height of places (..., 3) in the world above the ground below them, m, (...)."""
    return place[..., 2]


def in_contact(clearance: jax.Array) -> jax.Array:
    """1.0 where a foot with this clearance (...), m, touches the ground."""
    return (clearance < CONTACT_CLEARANCE_M).astype(clearance.dtype)
