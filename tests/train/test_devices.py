"""Training on several devices: each learns from its share, all end with the same parameters."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.train.brax.devices import caches_programs, device_mesh
from footfall.train.config import load_preset

SCRIPT = Path(__file__).parents[1] / "support" / "two_devices.py"
# The older partitioner, as with jax 0.11 (envs/workarounds/partitioner.py): Shardy compiles more.
TWO = {"JAX_NUM_CPU_DEVICES": "2", "JAX_PLATFORMS": "cpu", "JAX_USE_SHARDY_PARTITIONER": "0"}


@pytest.fixture(scope="module")
def results() -> dict[str, float]:
    done = subprocess.run(
        [sys.executable, str(SCRIPT)],
        env=os.environ | TWO, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout.splitlines()[-1])


def test_equal_shares_on_all_devices_train_as_one_device_does(results: dict[str, float]) -> None:
    assert results["moved"] > 1e-3
    assert results["same_share_on_both"] < 1e-6


def test_statistics_of_each_device_reach_all_devices(results: dict[str, float]) -> None:
    assert results["other_share_on_the_second"] > 1e-4
    assert results["between_devices"] == 0.0


def test_observation_statistics_are_those_of_all_devices(results: dict[str, float]) -> None:
    assert results["statistics"] < 1e-6


def test_environments_are_divided_and_parameters_are_everywhere(results: dict[str, float]) -> None:
    assert results["devices"] == 2
    assert results["environments_of_each"] == 16
    assert results["copies_of_parameters"] == 2


@pytest.mark.parametrize(
    ("platform", "visible", "cached"), [("gpu", 1, True), ("gpu", 2, False), ("cpu", 1, False)]
)
def test_only_programs_of_a_single_gpu_are_cached(
    monkeypatch: pytest.MonkeyPatch, platform: str, visible: int, cached: bool
) -> None:
    monkeypatch.setattr(jax, "device_count", lambda: visible)
    mesh: Any = SimpleNamespace(size=1, devices=np.array([SimpleNamespace(platform=platform)]))
    assert caches_programs(mesh) == cached


def test_environments_that_do_not_divide_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jax, "devices", lambda: ["one", "two"])
    config = replace(load_preset("smoke").ppo, num_envs=12, num_mini_batches=4)
    with pytest.raises(UserError, match=r"\b8\b"):
        device_mesh(config)
