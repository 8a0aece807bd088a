"""Training on several devices: each learns from its share, all end with the same parameters."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.sharding import PartitionSpec

from footfall.common.errors import UserError
from footfall.train.brax import devices
from footfall.train.brax.devices import device_mesh, on_cpu
from footfall.train.brax.state import STATE_SPECS
from footfall.train.config import load_preset

SCRIPT = Path(__file__).parents[1] / "support" / "two_devices.py"
# The older partitioner, as with jax 0.11 (envs/workarounds/partitioner.py): Shardy compiles more.
TWO = {"JAX_NUM_CPU_DEVICES": "2", "JAX_PLATFORMS": "cpu", "JAX_USE_SHARDY_PARTITIONER": "0"}


@pytest.fixture(scope="module")
def seen() -> dict[str, float]:
    done = subprocess.run(
        [sys.executable, str(SCRIPT)],
        env=os.environ | TWO, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


def test_equal_shares_on_all_devices_train_as_one_device_does(seen: dict[str, float]) -> None:
    assert seen["moved"] > 1e-3
    assert seen["same_share_on_both"] < 1e-6


def test_statistics_of_each_device_reach_all_devices(seen: dict[str, float]) -> None:
    assert seen["other_share_on_the_second"] > 1e-4
    assert seen["between_devices"] == 0.0


def test_environments_are_divided_and_parameters_are_everywhere(seen: dict[str, float]) -> None:
    assert seen["devices"] == 2
    assert seen["environments_of_each"] == 16
    assert seen["copies_of_parameters"] == 2


def test_on_accelerators_alone_the_default_device_computes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none_such(*_: object, **__: object) -> None:
        raise RuntimeError("Unknown backend cpu")

    monkeypatch.setattr(jax, "local_devices", none_such)
    with on_cpu():
        assert float(jax.numpy.ones(2).sum()) == 2.0


def test_environments_that_do_not_divide_are_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(jax, "devices", lambda: ["one", "two"])
    config = replace(load_preset("smoke").ppo, num_envs=12, num_mini_batches=4)
    with pytest.raises(UserError, match="among 2 devices and 4 mini-batches: give a multiple of 8"):
        device_mesh(config)


def test_the_mean_over_devices_is_of_each_leaf() -> None:
    assert devices.mean_over_devices(1)({"a": 3.0}) == {"a": 3.0}
    tree = {"a": jnp.arange(4.0), "b": jnp.arange(8.0).reshape(4, 2)}
    mean = jax.vmap(devices.mean_over_devices(4), axis_name=devices.AXIS)(tree)
    np.testing.assert_allclose(mean["a"], np.full(4, 1.5))
    np.testing.assert_allclose(mean["b"], np.tile([3.0, 4.0], (4, 1)))


def test_each_part_of_a_state_is_on_its_device() -> None:
    for name, spec in STATE_SPECS._asdict().items():
        assert spec == (PartitionSpec("devices") if name in ("env", "observation") else PartitionSpec())
    mesh = device_mesh(load_preset("smoke").ppo, 1)
    assert (mesh.size, mesh.axis_names) == (1, ("devices",))
    where = devices.shardings({"a": devices.REPLICATED, "b": devices.SHARDED}, mesh)
    placed = devices.place({"a": [np.arange(2.0), np.ones(3)], "b": {"c": np.arange(6.0)}}, where)
    assert [x.sharding.spec for x in placed["a"]] == [PartitionSpec()] * 2
    assert placed["b"]["c"].sharding.spec == PartitionSpec("devices")
    np.testing.assert_array_equal(placed["b"]["c"], np.arange(6.0))
