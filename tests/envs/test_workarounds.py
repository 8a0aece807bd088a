"""Each workaround of `envs/workarounds/` is still needed, and was tried with the releases that are installed.

A test that fails here after an upgrade means: the workaround in that file may be obsolete.
"""

import os
import signal
import subprocess
import sys
from importlib.metadata import version

import jax
import mujoco
import numpy as np
import pytest

from footfall.envs.physics.c import _Simulations
from footfall.envs.workarounds import fewer_kernels, partitioner, undisturbed
from footfall.envs.workarounds.undisturbed import UNDISTURBED
from footfall.robots.description import Robot
from footfall.robots.model import training_model

TRIED = {
    "jax": ("0.10.2", "0.11.2"),
    "mujoco": ("3.17.0",),
    "mujoco-mjx": ("3.17.0",),
    "brax": ("0.14.2",),
}


@pytest.mark.parametrize("package", TRIED)
def test_they_were_tried_with_this_release(package: str) -> None:
    assert version(package) in TRIED[package]


def time_spent(steps: int) -> float:
    """MuJoCo's own stopwatch for some steps, in seconds."""
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    data = mujoco.MjData(model)
    for _ in range(steps):
        mujoco.mj_step(model, data)
    return float(data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration)


def test_mujoco_times_its_steps_except_in_a_training() -> None:
    assert time_spent(3) > 0.0
    with UNDISTURBED:
        assert time_spent(3) == 0.0
    assert time_spent(3) > 0.0


def test_mujoco_has_no_option_to_run_without_its_clock() -> None:
    before = undisturbed._clock.value
    mujoco.set_mjcb_time(None)
    assert undisturbed._clock.value is not None
    assert undisturbed._clock.value == before


def test_jax_traces_a_function_again_that_it_has_compiled_before() -> None:
    """Its persistent cache is asked after that; program_cache saves the tracing."""
    traced = []

    def function(x: jax.Array) -> jax.Array:
        traced.append(x)
        return 2 * x

    for _ in range(2):
        jax.jit(function)(np.float32(1.0))
        jax.clear_caches()
    assert len(traced) == 2


ACCELERATIONS_ON_TWO_DEVICES = """
import jax
from jax.sharding import AxisType, PartitionSpec
from mujoco import mjx
from footfall.robots.description import load_robot
from footfall.robots.model import training_model

mesh = jax.make_mesh((2,), ("devices",), (AxisType.Auto,))
model = training_model(load_robot("go1"))
nominal, template = mjx.put_model(model), mjx.make_data(model)

def accelerations(qpos, qvel):
    return mjx.step(nominal, template.replace(qpos=qpos, qvel=qvel)).qacc

each = PartitionSpec("devices")
divided = jax.shard_map(
    jax.vmap(accelerations), mesh=mesh, in_specs=(each, each), out_specs=each, check_vma=False
)
shapes = (jax.ShapeDtypeStruct((8, size), "float32") for size in (model.nq, model.nv))
jax.jit(divided).lower(*shapes).compile()
"""


@pytest.mark.skipif(jax.__version_info__ < partitioner.CRASHES_SINCE, reason="Shardy works with this jax")
def test_shardy_crashes_on_mjx() -> None:
    two = {"JAX_NUM_CPU_DEVICES": "2", "JAX_PLATFORMS": "cpu"}
    command = [sys.executable, "-c", ACCELERATIONS_ON_TWO_DEVICES]
    done = subprocess.run(command, env=os.environ | two, capture_output=True, timeout=300, check=False)
    assert done.returncode == -signal.SIGSEGV


def test_shardy_is_avoided_only_where_it_crashes(monkeypatch: pytest.MonkeyPatch) -> None:
    changed: list[tuple[str, bool]] = []
    monkeypatch.setattr(jax.config, "update", lambda *change: changed.append(change))
    for release, expected in (((0, 10, 2), []), ((0, 11, 2), [("jax_use_shardy_partitioner", False)])):
        monkeypatch.setattr(jax, "__version_info__", release)
        partitioner.avoid_crashing_partitioner()
        assert changed == expected


def test_results_written_to_a_copy_are_noticed(go1: Robot) -> None:
    """`buffer_callback` hands over XLA's memory; a reshape of it might copy."""
    simulations = _Simulations(training_model(go1), go1)
    memory = {"qpos": np.zeros((2, 3, 4), np.float32)}
    simulations._check_views(memory, {"qpos": memory["qpos"].reshape(-1, 4)})
    with pytest.raises(AssertionError, match="written to a copy"):
        _Simulations(training_model(go1), go1)._check_views(memory, {"qpos": memory["qpos"].copy()})


def test_functions_replaced_by_others_are_not_replaced_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    monkeypatch.setattr(jax.ops, "segment_sum", lambda *_: None)
    with pytest.raises(AssertionError, match="other code has replaced"), fewer_kernels.fewer_kernels():
        pass


def test_mujocos_settings_stay_until_the_last_training_ends() -> None:
    before = mujoco.get_mju_user_warning()
    with UNDISTURBED:
        inside = mujoco.get_mju_user_warning()
        assert inside is not before
        with UNDISTURBED:
            assert mujoco.get_mju_user_warning() is inside
        assert mujoco.get_mju_user_warning() is inside  # the first is still inside
    assert mujoco.get_mju_user_warning() is before
