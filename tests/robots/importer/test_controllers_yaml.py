"""Settings of controllers, scaled from a shipped robot to another size."""

from typing import Any

import pytest
import yaml

from footfall.common.config import read_yaml
from footfall.robots.description import ROBOTS
from footfall.robots.importer.controllers_yaml import Size, controllers_yaml, scaled_controllers

GO1 = Size(12.743448, 0.2944696, 0.2944696, 0.1998277, 2e-3, 2e-3)


def at(section: Any, key: str) -> Any:
    for name in key.split("."):
        section = section[name]
    return section


def test_a_robot_of_the_same_size_gets_the_same_settings() -> None:
    """All are equal except those of `stand`, whose stiffness comes from the robot's own gains."""
    shipped = read_yaml(ROBOTS / "go1" / "controllers.yaml")
    scaled = scaled_controllers(GO1, 4, 0.0).sections
    for key in ("mpc.weights.force", "mpc-wbc.swing.stiffness", "trot.kd", "walk.stance.sway", "stand.kp"):
        assert at(scaled, key) == pytest.approx(at(shipped, key), rel=1e-3)
    assert scaled_controllers(GO1, 4, 300.0).sections["stand"]["kp"] == pytest.approx(300.0)


def test_a_bipeds_steps_have_the_width_of_its_stance_and_pressure_stays_within_its_soles() -> None:
    narrow = Size(33.3411, 0.7720737, 0.7720737, 0.5 * 0.237014, 0.5 * 0.17, 0.25 * 0.06)
    settings = scaled_controllers(narrow, 2, 0.0).sections["step"]
    assert settings["gait"]["apart_m"] == pytest.approx(0.1, rel=1e-3)
    assert settings["pressure"]["half_length_m"] == pytest.approx(0.0375, rel=1e-3)
    assert settings["pressure"]["half_width_m"] == pytest.approx(0.00625, rel=1e-2)


def test_a_biped_on_two_points_steps_at_once_and_faster_and_cannot_stand() -> None:
    soles = Size(33.3411, 0.7720737, 0.7720737, 0.237014, 0.17, 0.06)
    points = scaled_controllers(soles._replace(sole_length_m=2e-3, sole_width_m=2e-3), 2, 0.0).sections
    assert list(points) == ["step"]
    usual = scaled_controllers(soles, 2, 0.0).sections["step"]
    assert points["step"]["gait"]["step_s"] < 0.7 * usual["gait"]["step_s"]
    assert points["step"]["start"]["capture_m"] < 0.01 * usual["start"]["capture_m"]


def test_legs_that_cannot_move_sideways_keep_their_width() -> None:
    flat = scaled_controllers(GO1._replace(spread_m=0.0), 4, 0.0).sections
    assert flat["trot"]["stance"]["outward_m"] == flat["mpc"]["stance"]["outward_m"] == 0.0
    assert flat["mpc"]["gait"]["duty"] == flat["mpc-wbc"]["plan"]["gait"]["duty"] > 0.6


def test_controllers_whose_gait_the_robot_does_not_have_are_left_out() -> None:
    text = controllers_yaml(scaled_controllers(GO1, 5, 0.0), ["wave"])
    assert list(yaml.safe_load(text)) == ["stand", "wave"]
    soles = Size(33.3411, 0.7720737, 0.7720737, 0.237014, 0.17, 0.06)
    for gaits, steps in ((["walk"], True), ([], False)):  # two feet on one side have no gait
        assert ("step" in yaml.safe_load(controllers_yaml(scaled_controllers(soles, 2, 0.0), gaits))) == steps
