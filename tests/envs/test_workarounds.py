"""Each workaround of `envs/workarounds/` is still needed, and was tried with the releases that are installed.

A test that fails here after an upgrade means: the workaround in that file may be obsolete.
"""

from importlib.metadata import version

import jax
import mujoco
import pytest

from footfall.envs.workarounds import partitioner
from footfall.envs.workarounds.undisturbed import UNDISTURBED

TRIED = {
    "jax": ("0.10.2", "0.11.2"),
    "mujoco": ("3.17.0",),
    "mujoco-mjx": ("3.17.0",),
    "brax": ("0.14.2",),
}


@pytest.mark.parametrize("package", TRIED)
def test_workarounds_were_tried_with_the_installed_release(package: str) -> None:
    assert version(package) in TRIED[package]


def time_spent() -> float:
    """MuJoCo's own stopwatch for three steps, in seconds."""
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody/></mujoco>")
    data = mujoco.MjData(model)
    for _ in range(3):
        mujoco.mj_step(model, data)
    return float(data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration)


def test_mujoco_times_its_steps_except_in_a_training() -> None:
    assert time_spent() > 0.0
    with UNDISTURBED:
        assert time_spent() == 0.0
    assert time_spent() > 0.0


def test_shardy_is_avoided_only_where_it_crashes(monkeypatch: pytest.MonkeyPatch) -> None:
    changed: list[tuple[str, bool]] = []
    monkeypatch.setattr(jax.config, "update", lambda *change: changed.append(change))
    for release, expected in (((0, 10, 2), []), ((0, 11, 2), [("jax_use_shardy_partitioner", False)])):
        monkeypatch.setattr(jax, "__version_info__", release)
        partitioner.avoid_crashing_partitioner()
        assert changed == expected


def test_mujocos_settings_stay_until_the_last_training_ends() -> None:
    before = mujoco.get_mju_user_warning()
    with UNDISTURBED:
        inside = mujoco.get_mju_user_warning()
        assert inside is not before
        with UNDISTURBED:
            assert mujoco.get_mju_user_warning() is inside
        assert mujoco.get_mju_user_warning() is inside  # the first training still runs
    assert mujoco.get_mju_user_warning() is before
