"""Motors and gains of an imported robot."""

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import pytest
from rods import hinge, rod_machine

from footfall.common.errors import UserError
from footfall.robots.importer.machine import Hinge
from footfall.robots.importer.motors import Drive, choose_drive, peak_torques
from footfall.robots.importer.source import Source
from footfall.robots.importer.statics import Statics


def source_of(tmp_path: Path, peak: dict[str, float], speed: dict[str, float] | None = None) -> Source:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    return Source(tmp_path / "m.urdf", model, False, {}, peak, speed or {})


CALM = Statics(np.zeros(3), np.zeros((0, 0)), np.zeros((3, 0)))  # no weight, nothing to tip


HINGES = hinge("a", 0.5), hinge("b"), hinge("c")


def drive_of(
    tmp_path: Path,
    hinges: Sequence[Hinge],
    torque: Sequence[float],
    statics: Statics = CALM,
    given: dict[str, float] | None = None,
    speed: dict[str, float] | None = None,
) -> Drive:
    machine = rod_machine(hinges)
    peak = {each.name: value for each, value in zip(hinges, torque, strict=True)}
    return choose_drive(machine, source_of(tmp_path, peak, speed), peak, given or {}, statics)


def test_the_middle_joint_has_peak_torque_at_0_75_rad(tmp_path: Path) -> None:
    """20 N m over 0.01 kg m^2 and 0.75 rad give 51.6 rad/s or 8.2 Hz, which is rounded down to 8 Hz."""
    drive = drive_of(tmp_path, HINGES, (10.0, 20.0, 90.0))
    assert (drive.natural_frequency_hz, drive.stands) == (8.0, True)


def test_motors_that_are_too_weak_to_stand_are_refused_the_worst_first(tmp_path: Path) -> None:
    heavy = CALM._replace(torque_nm=np.array([11.0, -60.0, 89.0]))
    with pytest.raises(UserError, match=r"b 60 .*20 .*a 11 .*10 .*--peak-torque"):
        drive_of(tmp_path, HINGES, (10.0, 20.0, 90.0), heavy)


def test_an_action_moves_no_joint_by_more_than_nine_tenths_of_its_range(tmp_path: Path) -> None:
    """kp = 0.01 (2 pi 8)^2 = 25.27 N m/rad; 0.5 rad then need 0.1263 of 90 N m."""
    tight = drive_of(tmp_path, (hinge("a"), hinge("b"), hinge("c", 0.5)), (10.0, 20.0, 90.0))
    assert tight.torque_share == 0.126
    assert drive_of(tmp_path, HINGES, (10.0, 20.0, 20.0)).torque_share == 0.3


def test_stiffness_is_twice_the_least_that_keeps_it_from_tipping(tmp_path: Path) -> None:
    """Gravity takes 10 N m/rad from the second joint, which gets 20 N m/rad at 7.12 Hz."""
    tipping = Statics(np.zeros(3), np.array([[-10.0]]), np.array([[0.0], [1.0], [0.0]]))
    drive = drive_of(tmp_path, HINGES, (1.0, 1.0, 1.0), tipping)
    assert drive.natural_frequency_hz == 7.5
    assert any("7.5 Hz" in guess for guess in drive.guesses)


def test_an_unstable_robot_gets_the_usual_stiffness_and_a_note(tmp_path: Path) -> None:
    tipping = Statics(np.zeros(3), np.array([[-1e9]]), np.array([[0.0], [1.0], [0.0]]))
    drive = drive_of(tmp_path, HINGES, (10.0, 20.0, 90.0), tipping)
    assert (drive.natural_frequency_hz, drive.stands) == (8.0, False)
    assert any("cannot stand by joint stiffness" in guess for guess in drive.guesses)


def test_speeds_are_the_users_or_else_the_files_if_plausible(tmp_path: Path) -> None:
    drive = drive_of(tmp_path, HINGES, (20.0,) * 3, given={"a": 12.0}, speed={"a": 3.0, "b": 59.0, "c": 61.0})
    assert [drive.motors[name].no_load_speed_rad_s for name in "abc"] == [12.0, 59.0, 30.0]
    assert [guess for guess in drive.guesses if "no-load speed of" in guess] == [
        "no-load speed of c: 30 rad/s"
    ]
    unsaid = drive_of(tmp_path, HINGES, (20.0,) * 3)
    assert [motor.no_load_speed_rad_s for motor in unsaid.motors.values()] == [30.0] * 3


@pytest.mark.parametrize(("torque", "taken"), [(94.0, True), (95.0, False)])
def test_torque_is_at_most_3_weights(tmp_path: Path, torque: float, taken: bool) -> None:
    """8 kg * 9.81 m/s^2 * 0.4 m * 3 = 94.2 N m; the user's value is kept."""
    machine = rod_machine(HINGES)
    source = source_of(tmp_path, {"a": 10.0, "b": torque, "c": 10.0})
    if taken:
        assert peak_torques(machine, source, {}, 0.4)["b"] == torque
    else:
        with pytest.raises(UserError, match=r"joint b .*95"):
            peak_torques(machine, source, {}, 0.4)
    assert peak_torques(machine, source, {"b": 200.0, "": 5.0}, 0.4) == {"a": 5.0, "b": 200.0, "c": 5.0}
    bare = source_of(tmp_path, {"a": 10.0, "c": 10.0})
    assert peak_torques(machine, bare, {"b": 200.0}, 0.4)["b"] == 200.0
    with pytest.raises(UserError, match="joint b"):
        peak_torques(machine, bare, {}, 0.4)
