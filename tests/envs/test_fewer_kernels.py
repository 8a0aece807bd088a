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
from long_tests import long_test
from mujoco import mjx

from footfall.envs.workarounds.fewer_kernels import fewer_kernels, insert, segment_sum
from footfall.robots.description import Robot
from footfall.robots.model import training_model

ROBOTS = 16


@pytest.fixture
def on_a_gpu(monkeypatch: pytest.MonkeyPatch) -> None:
    """Traced as if for a GPU, computed by the processor."""
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")


@pytest.mark.parametrize(
    ("segments", "ids"), [(1, [0]), (1, [0, 0, 0]), (4, [2]), (3, [2, 0, 2, 2, 0]), (5, [4, 3, 0, 0, 1, 4])]
)
def test_sums_are_those_of_jax(segments: int, ids: list[int]) -> None:
    data = np.random.default_rng(0).normal(size=(len(ids), 3)).astype(np.float32)
    expected = jax.ops.segment_sum(data, np.array(ids), segments)
    np.testing.assert_allclose(segment_sum(jnp.asarray(data), np.array(ids), segments), expected, rtol=1e-5)


@pytest.mark.parametrize("ids", [np.arange(4), np.zeros(4, int)], ids=["one each", "all one"])
def test_sums_over_legs_are_no_scatters(ids: np.ndarray) -> None:
    data, segments = jnp.arange(12.0).reshape(4, 3), int(ids.max()) + 1
    np.testing.assert_array_equal(segment_sum(data, ids, segments), jax.ops.segment_sum(data, ids, segments))
    assert "scatter" not in str(jax.make_jaxpr(lambda x: segment_sum(x, ids, segments))(data))


@pytest.mark.parametrize(("size", "where"), [(1, 0), (1, 1), (4, -4), (4, -1), (4, 2), (4, 4)])
def test_insertions_are_those_of_jax(size: int, where: int) -> None:
    array = jnp.arange(float(size))
    np.testing.assert_array_equal(insert(array, where, -1.0), jnp.insert(array, where, -1.0))
    np.testing.assert_array_equal(insert(array, 0, jnp.ones(2)), jnp.insert(array, 0, jnp.ones(2)))


def test_values_unknown_while_tracing_are_left_to_jax() -> None:
    data, ids = jnp.ones((3, 2)), jnp.array([0, 2, 2])
    np.testing.assert_array_equal(jax.jit(lambda i: segment_sum(data, i, 3))(ids), [[1, 1], [0, 0], [2, 2]])
    np.testing.assert_array_equal(segment_sum(data, np.array([0, 0, 1])), [[2, 2], [1, 1]])


@long_test
@pytest.mark.usefixtures("on_a_gpu")
def test_a_step_of_mjx_moves_robots_the_same(go1: Robot) -> None:
    model = training_model(go1)
    nominal, template = mjx.put_model(model), mjx.make_data(model)
    rng = np.random.default_rng(1)
    qpos = np.tile(model.qpos0, (ROBOTS, 1))
    qpos[:, 2] = rng.uniform(0.2, 0.35, ROBOTS)  # some in the air, some pressed into the floor
    qpos[:, 7:] = go1.default_pose + rng.uniform(-0.3, 0.3, (ROBOTS, 12))
    qvel, force = rng.normal(0.0, 1.0, (ROBOTS, model.nv)), rng.normal(0.0, 5.0, (ROBOTS, model.nv))

    def step(qpos: jax.Array, qvel: jax.Array, force: jax.Array) -> tuple[jax.Array, jax.Array]:
        data = mjx.step(nominal, template.replace(qpos=qpos, qvel=qvel, qfrc_applied=force))
        return data.qpos, data.qvel

    def fewer(*state: jax.Array) -> tuple[jax.Array, jax.Array]:
        with fewer_kernels():
            return step(*state)

    state = [jnp.asarray(x, jnp.float32) for x in (qpos, qvel, force)]
    was, now = (jax.jit(jax.vmap(function)).lower(*state) for function in (step, fewer))
    for before, after in zip(was.compile()(*state), now.compile()(*state), strict=True):
        np.testing.assert_allclose(after, before, rtol=1e-4, atol=1e-4)
    assert (operations(was)["while"], operations(now)["while"]) == (1, 0)
    assert operations(now)["scatter"] < operations(was)["scatter"] / 4


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
def test_afterwards_jax_is_restored() -> None:
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


def test_a_sum_over_a_segment_excludes_other_rows() -> None:
    rows = jnp.array([[1.0, 2.0], [10.0, 20.0], [100.0, 200.0]])
    for ids, total in (([0, 0, 0], [111.0, 222.0]), ([0, 1, 0], [101.0, 202.0])):
        np.testing.assert_allclose(segment_sum(rows, np.array(ids), 1), [total])
