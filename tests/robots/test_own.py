"""A robot of the user's own: other names, another joint order."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from footfall.robots.description import Robot, load_robot
from footfall.robots.model import joint_addresses, plant_model, training_model


def test_a_robot_may_have_other_names_and_another_joint_order(own_folder: Path, go1: Robot) -> None:
    def rename(text: str) -> str:
        return re.sub(r"\b(FR|FL|RR|RL)_(\w+)", r"leg\1_\2", text)

    xml, declaration = own_folder / "robot.xml", own_folder / "robot.yaml"
    xml.write_text(rename(xml.read_text()))
    content = yaml.safe_load(rename(declaration.read_text()))
    content["name"] = "mine"
    content["joints"].reverse()
    declaration.write_text(yaml.safe_dump(content))
    mine = load_robot(own_folder)
    assert mine.name == "mine"
    assert mine.joint_names == tuple(f"leg{name}" for name in reversed(go1.joint_names))
    assert mine.digest != go1.digest
    for figure in ("default_pose", "lower_rad", "upper_rad", "armature", "kp", "kd", "action_scale"):
        np.testing.assert_array_equal(getattr(mine, figure), getattr(go1, figure)[::-1])
    np.testing.assert_array_equal(mine.motor.peak_torque, go1.motor.peak_torque[::-1])
    np.testing.assert_array_equal(np.array(mine.foot_joints), 11 - np.array(go1.foot_joints))
    for make in (plant_model, training_model):
        model = make(mine)
        positions, dofs = joint_addresses(model, mine)
        assert positions.tolist() == list(range(18, 6, -1))
        assert dofs.tolist() == list(range(17, 5, -1))
        assert model.body_mass.sum() == pytest.approx(plant_model(go1).body_mass.sum())
