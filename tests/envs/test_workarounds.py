"""Workarounds for JAX, MuJoCo and brax: they act as intended, and were tried with the installed releases.

A test that fails here after an upgrade means: the workaround in that file may be obsolete.
"""

import re
import subprocess
import sys
from collections import Counter
from contextlib import suppress
from importlib.metadata import version
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest
from brax.training import networks
from brax.training.agents.ppo.losses import compute_gae

from footfall.envs.workarounds import partitioner
from footfall.envs.workarounds.fewer_kernels import fewer_kernels, insert, segment_sum
from footfall.envs.workarounds.undisturbed import UNDISTURBED
from footfall.train.brax.numpy_zeros import numpy_zeros

TRIED = {"jax": ("0.10.2", "0.11.2"), "mujoco": ("3.17.0",), "mujoco-mjx": ("3.17.0",), "brax": ("0.14.2",)}


def test_workarounds_were_tried_with_the_installed_releases() -> None:
    assert [package for package, tried in TRIED.items() if version(package) not in tried] == []


def time_spent() -> float:
    """MuJoCo's own stopwatch for three steps, in seconds."""
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    data = mujoco.MjData(model)
    for _ in range(3):
        mujoco.mj_step(model, data)
    return float(data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration)


def test_mujoco_times_its_steps_and_warns_except_until_the_last_training_ends() -> None:
    before = mujoco.get_mju_user_warning()
    assert time_spent() > 0.0
    with UNDISTURBED:
        inside = mujoco.get_mju_user_warning()
        assert inside is not before
        with UNDISTURBED:
            assert mujoco.get_mju_user_warning() is inside
        assert mujoco.get_mju_user_warning() is inside  # the first training still runs
        assert time_spent() == 0.0
    assert mujoco.get_mju_user_warning() is before
    assert time_spent() > 0.0


def test_shardy_is_avoided_only_where_it_crashes(monkeypatch: pytest.MonkeyPatch) -> None:
    changed: list[tuple[str, bool]] = []
    monkeypatch.setattr(jax.config, "update", lambda *change: changed.append(change))
    for release, expected in (((0, 10, 2), []), ((0, 11, 2), [("jax_use_shardy_partitioner", False)])):
        monkeypatch.setattr(jax, "__version_info__", release)
        partitioner.avoid_crashing_partitioner()
        assert changed == expected


IMPORTS = """
import sys
import gymnasium
from footfall.train.entry import learning_libraries
with learning_libraries():
    import footfall.train.api, footfall.train.brax.trainer
gymnasium.make("footfall.gym:footfall/Go1Velocity-v0")
print("mujoco.mjx" in sys.modules, "trimesh" in sys.modules)
import footfall.envs.physics.mjx, brax
print(brax.State.__module__, brax.System.__module__)
"""


def test_imports_print_nothing_and_bring_no_simulator_before_it_is_used() -> None:
    done = subprocess.run([sys.executable, "-c", IMPORTS], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines() == ["False False", "brax.base brax.base"]


class TestFewerKernels:
    """Tracing for a GPU with fewer kernels gives the same results and changes only programs for GPUs."""

    @pytest.fixture(autouse=True)
    def on_a_gpu(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Programs are traced as for a GPU and computed by the processor."""
        monkeypatch.setattr(jax, "default_backend", lambda: "gpu")

    @pytest.mark.parametrize(
        ("segments", "ids"),
        [(1, [0]), (1, [0, 0, 0]), (4, [2]), (3, [2, 0, 2, 2, 0]), (5, [4, 3, 0, 0, 1, 4])],
    )
    def test_sums_are_those_of_jax(self, segments: int, ids: list[int]) -> None:
        data = np.random.default_rng(0).normal(size=(len(ids), 3)).astype(np.float32)
        expected = jax.ops.segment_sum(data, np.array(ids), segments)
        found = segment_sum(jnp.asarray(data), np.array(ids), segments)
        np.testing.assert_allclose(found, expected, rtol=1e-5)

    @pytest.mark.parametrize(("size", "where"), [(1, 0), (1, 1), (4, -4), (4, -1), (4, 2), (4, 4)])
    def test_insertions_are_those_of_jax(self, size: int, where: int) -> None:
        array = jnp.arange(float(size))
        for index, value in ((where, -1.0), (0, jnp.ones(2))):
            np.testing.assert_array_equal(insert(array, index, value), jnp.insert(array, index, value))

    def test_advantages_are_the_same_without_a_loop(self) -> None:
        rng = np.random.default_rng(2)
        flags, values = rng.integers(0, 2, (2, 8, 16)), rng.normal(size=(2, 8, 16))
        arrays = [jnp.asarray(x, jnp.float32) for x in (*flags, *values, rng.normal(size=16))]

        def fewer(*arrays: jax.Array) -> Any:
            with fewer_kernels():
                return compute_gae(*arrays)

        was, now = (jax.jit(function).lower(*arrays) for function in (compute_gae, fewer))
        for before, after in zip(was.compile()(*arrays), now.compile()(*arrays), strict=True):
            np.testing.assert_allclose(after, before, rtol=1e-5, atol=1e-6)
        counts = [Counter(re.findall(r'stablehlo\.(\w+)"?\(', each.as_text())) for each in (was, now)]
        assert [count["while"] for count in counts] == [1, 0]

    def test_replaced_functions_are_restored_afterwards(self) -> None:
        before = (jax.lax.scan, jax.ops.segment_sum, jnp.insert, networks.jnp)
        with suppress(KeyError), fewer_kernels(), numpy_zeros():
            assert jax.lax.scan is not before[0]
            assert (jax.ops.segment_sum, jnp.insert, networks.jnp) == (segment_sum, insert, np)
            raise KeyError
        assert (jax.lax.scan, jax.ops.segment_sum, jnp.insert, networks.jnp) == before
