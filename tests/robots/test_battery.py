"""A declared battery."""

from pathlib import Path

import pytest
import yaml

from footfall.common.errors import UserError
from footfall.robots.battery import CHEMISTRIES, Battery
from footfall.robots.description import load_robot

CHEMISTRY_NAMES = list(yaml.safe_load(CHEMISTRIES.read_text()))


@pytest.mark.parametrize("chemistry", CHEMISTRY_NAMES)
def test_charge_and_voltage_at_rest_are_one_curve(chemistry: str) -> None:
    battery = Battery(6, 100.0, 0.05, chemistry)
    for charge in (0.0, 0.03, 0.5, 0.77, 1.0):
        assert battery.charge_at(battery.open_circuit_v(charge)) == pytest.approx(charge)
    assert battery.open_circuit_v(0.0) == battery.empty_v < battery.nominal_v < battery.open_circuit_v(1.0)


def test_a_battery_is_declared_in_robot_yaml_and_no_policy_depends_on_it(own_folder: Path) -> None:
    digest = load_robot(own_folder).digest
    text = (own_folder / "robot.yaml").read_text()
    pack = {"cells": 2, "capacity_wh": 50.0, "internal_resistance_ohm": 0.1}
    for change, why in (
        ({"voltage_curve": [[0.0, 3.0], [1.0, 4.0]]}, ""),
        ({"voltage_curve": [[0.0, 3.0], [1.0, 2.0]]}, "voltage_curve"),
        ({"voltage_curve": [[0.1, 3.0], [1.0, 4.0]]}, "voltage_curve"),
        ({"chemistry": "lead"}, "'lead'"),
        ({"cells": 0}, "cells"),
        ({"capacity_wh": 0.0}, "capacity_wh"),
        ({"volume": 1.0}, "volume"),
    ):
        (own_folder / "robot.yaml").write_text(text + yaml.safe_dump({"battery": pack | change}))
        if why:
            with pytest.raises(UserError, match=why):
                load_robot(own_folder)
        else:
            robot = load_robot(own_folder)
            assert robot.digest == digest
            assert robot.description.battery is not None
            assert robot.description.battery.open_circuit_v(0.5) == 7.0
