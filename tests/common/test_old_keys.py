"""Settings under the keys of earlier versions."""

from pathlib import Path

import pytest

from footfall.common.config import load
from footfall.common.errors import UserError
from footfall.deploy.config import deploy_config
from footfall.identify.gain_search import GainConfig
from footfall.policies.registry import load_settings
from footfall.robots.description import Robot


def test_files_and_specs_with_old_keys_still_load(go1: Robot, tmp_path: Path) -> None:
    file = tmp_path / "old.yaml"
    file.write_text("contact: {most_force_n: 150}\nslope: {most: 0.4, ignored: 0.1}\n")
    for spec in (f"mpc@{file}", "mpc@contact.most_force_n=150@slope.most=0.4@slope.ignored=0.1"):
        settings = load_settings(spec, go1)
        assert settings.contact.max_force_n == 150.0
        assert (settings.slope.max_gradient, settings.slope.deadband) == (0.4, 0.1)
    wbc = load_settings("mpc-wbc@whole_body.contact.damping_s=3.0", go1)
    assert wbc.whole_body.contact.damping == 3.0
    assert load_settings("trot@touch_down.inertia_doubt=0.3", go1).touch_down.inertia_uncertainty == 0.3
    file.write_text(
        "safety: {recovery: {asked: true}, battery: {least_share: 0.7, off_cell_v: 0.4}, "
        "sensors: {limp_s: 0.2}}"
    )
    safety = deploy_config(go1, file).safety
    assert safety.recovery.on_request
    assert (safety.battery.min_share, safety.battery.max_cell_deviation_v) == (0.7, 0.4)
    assert safety.sensors.no_torque_s == 0.2
    file.write_text("{most: 2.0, back_to: 0.5}")
    assert load(file, GainConfig) == GainConfig(max_gain=2.0, backoff=0.5)


def test_an_old_key_beside_its_new_one_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "both.yaml"
    file.write_text("{most: 2.0, max_gain: 3.0}")
    with pytest.raises(UserError, match=r"both\.yaml.*most"):
        load(file, GainConfig)
