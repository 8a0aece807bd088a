"""Scalars in one array: by name inside a program, and on the host."""

import jax
import jax.numpy as jnp

from footfall.train.stacked import StackedScalars, floats


def test_scalars_keep_their_names_through_a_program_and_to_the_host() -> None:
    @jax.jit
    def program(x: jax.Array) -> StackedScalars:
        steps = jax.lax.map(lambda each: StackedScalars.of({"b": each, "a": 2.0 * each}), x)
        return steps.mean(axis=0)

    found = program(jnp.array([1.0, 2.0, 6.0]))
    assert floats(found) == {"a": 6.0, "b": 3.0}
    assert float(found["b"]) == 3.0
    assert set(found) == {"a", "b"}


def test_scalars_that_are_not_stacked_are_read_separately() -> None:
    assert floats({"a": jnp.float32(1.0), "b": 2}) == {"a": 1.0, "b": 2.0}
