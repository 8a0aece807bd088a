"""The hidden robot on which policies of identified ranges are compared."""

import shutil
from pathlib import Path

import numpy as np
from identified_policies import with_nominal_losses

from footfall.robots.description import Robot
from footfall.robots.model import read_plant


def test_a_folders_damping_is_not_added_to_the_hidden_robots(go1: Robot, tmp_path: Path) -> None:
    folder = tmp_path / "identified"
    shutil.copytree(go1.folder, folder)
    model = folder / go1.description.model
    model.write_text(model.read_text().replace("<joint ", '<joint damping="0.1" '))
    found = read_plant(with_nominal_losses(str(folder)), go1.xml_path).motor
    np.testing.assert_array_equal(found.damping, go1.motor.damping)
    np.testing.assert_array_equal(found.friction, go1.motor.friction)
