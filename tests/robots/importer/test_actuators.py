"""Actuators with published figures."""

import re
from pathlib import Path

import pytest
from foreign_robots import make, quadruped

from footfall.common.errors import UserError
from footfall.robots.importer.actuators import actuators


def test_every_row_has_a_source_and_a_plausible_inertia() -> None:
    for name, row in actuators().items():
        assert row.source, name
        assert row.rated_torque_nm is None or row.rated_torque_nm < row.peak_torque_nm, name
        assert row.armature is None or 2e-5 < row.armature / row.peak_torque_nm < 2e-3, name
    assert actuators()["Unitree-Go1-hip"].armature == pytest.approx(0.00403, rel=1e-2)


def test_a_robot_of_known_motors(tmp_path: Path) -> None:
    chosen = {"": "Unitree-Go1-hip", "knee": "Unitree-Go1-knee"}
    robot, made = make(tmp_path, quadruped(), actuators=chosen)
    hip, knee = robot.joint_index("FL_hip"), robot.joint_index("FL_knee")
    assert robot.motor.peak_torque[[hip, knee]] == pytest.approx([23.7, 35.55])
    assert robot.motor.no_load_speed[[hip, knee]] == pytest.approx([30.1, 20.06])
    assert robot.armature[[hip, knee]] == pytest.approx([0.00403, 0.00906], rel=1e-2)
    assert robot.motor_figures("gear_ratio")[[hip, knee]] == pytest.approx([6.0, 9.0])
    assert any("Unitree-Go1-knee: Unitree, go1_description" in guess for guess in made.guesses)
    assert not any("reflected inertia" in guess for guess in made.guesses)
    assert "gear_ratio: 9" in (made.folder / "robot.yaml").read_text()


def test_unknown_actuators_are_refused(tmp_path: Path) -> None:
    for chosen, named in (
        ({"": "DM-J4310-2EC-24"}, r"mean DM-J4310-2EC-24V\?"),
        ({"elbow": "Unitree-4010"}, "'elbow'"),
    ):
        with pytest.raises(UserError, match=named):
            make(tmp_path, quadruped(), actuators=chosen)


def test_motors_beyond_their_rated_torque_are_reported(tmp_path: Path) -> None:
    heavy = quadruped().replace('value="5.3"', 'value="9.3"')
    _, made = make(tmp_path, heavy, actuators={"": "DM-J4310-2EC-48V"})
    (warning,) = (guess for guess in made.guesses if "beyond their rated torque" in guess)
    assert "of 3 N m" in warning


def test_a_negative_torque_counts_by_its_magnitude(tmp_path: Path) -> None:
    """The knee of one leg turns about the opposite axis."""
    heavy = quadruped().replace('value="5.3"', 'value="9.3"')
    knee = re.search(r'<joint name="FL_knee".*?</joint>', heavy, re.DOTALL)
    assert knee is not None
    turned = re.sub(r'lower="-([\d.]+)" upper="-([\d.]+)"', r'lower="\2" upper="\1"', knee[0])
    turned = turned.replace('axis xyz="0 1 0"', 'axis xyz="0 -1 0"')
    _, made = make(tmp_path, heavy.replace(knee[0], turned), actuators={"": "DM-J4310-2EC-48V"})
    (warning,) = (guess for guess in made.guesses if "beyond their rated torque" in guess)
    assert "FL_knee" in warning
