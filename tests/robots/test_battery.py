"""A declared battery."""

from pathlib import Path

import pytest
import yaml

from footfall.common.errors import UserError
from footfall.robots.description import load_robot


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
