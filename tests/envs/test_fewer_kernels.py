"""Tracing for a GPU with fewer kernels gives the same results and changes only programs for GPUs."""

import re
from collections import Counter
from contextlib import suppress
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from brax.training.agents.ppo.losses import compute_gae

from footfall.envs.workarounds.fewer_kernels import fewer_kernels, insert, segment_sum

ROBOTS = 16


@pytest.fixture
def on_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """Programs are traced as for a GPU and computed by the processor."""
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")


@pytest.mark.parametrize(
    ("segments", "ids"), [(1, [0]), (1, [0, 0, 0]), (4, [2]), (3, [2, 0, 2, 2, 0]), (5, [4, 3, 0, 0, 1, 4])]
)
def test_sums_are_those_of_jax(segments: int, ids: list[int]) -> None:
    data = np.random.default_rng(0).normal(size=(len(ids), 3)).astype(np.float32)
    expected = jax.ops.segment_sum(data, np.array(ids), segments)
    np.testing.assert_allclose(segment_sum(jnp.asarray(data), np.array(ids), segments), expected, rtol=1e-5)


@pytest.mark.parametrize(("size", "where"), [(1, 0), (1, 1), (4, -4), (4, -1), (4, 2), (4, 4)])
def test_insertions_are_those_of_jax(size: int, where: int) -> None:
    array = jnp.arange(float(size))
    np.testing.assert_array_equal(insert(array, where, -1.0), jnp.insert(array, where, -1.0))
    np.testing.assert_array_equal(insert(array, 0, jnp.ones(2)), jnp.insert(array, 0, jnp.ones(2)))


@pytest.mark.usefixtures("on_a_gpu")
def test_advantages_are_the_same_without_a_loop() -> None:
    rng = np.random.default_rng(2)
    flags, values = rng.integers(0, 2, (2, 8, ROBOTS)), rng.normal(size=(2, 8, ROBOTS))
    arrays = [jnp.asarray(x, jnp.float32) for x in (*flags, *values, rng.normal(size=ROBOTS))]

    def fewer(*arrays: jax.Array) -> Any:
        with fewer_kernels():
            return compute_gae(*arrays)

    was, now = (jax.jit(function).lower(*arrays) for function in (compute_gae, fewer))
    for before, after in zip(was.compile()(*arrays), now.compile()(*arrays), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-5, atol=1e-6)
    assert (operations(was)["while"], operations(now)["while"]) == (1, 0)


@pytest.mark.usefixtures("on_a_gpu")
def test_jaxs_functions_are_restored_afterwards() -> None:
    scan, sums, insertion = jax.lax.scan, jax.ops.segment_sum, jnp.insert
    with suppress(KeyError), fewer_kernels():
        assert jax.lax.scan is not scan
        assert jax.ops.segment_sum is segment_sum
        assert jnp.insert is insert
        raise KeyError
    assert (jax.lax.scan, jax.ops.segment_sum, jnp.insert) == (scan, sums, insertion)


def operations(given: jax.stages.Lowered) -> Counter[str]:
    """Number of occurrences of each operation in the text for XLA."""
    return Counter(re.findall(r'stablehlo\.(\w+)"?\(', given.as_text()))
