"""Forward and upward axis of an imported base."""

from pathlib import Path

import pytest
from foreign_robots import BIPED_MJCF, read

from footfall.common.errors import UserError
from footfall.robots.importer.build import build_machine
from footfall.robots.importer.limbs import base_of
from footfall.robots.importer.orientation import side_letters, with_base_axes


def renamed(text: str) -> str:
    """The biped's file with left and right exchanged, as if its x axis pointed backward."""
    return text.replace("left", "LEFT").replace("right", "left").replace("LEFT", "right")


def test_sides_are_read_from_names() -> None:
    for names, sides in (
        (["FL_calf", "FR_calf", "RL_calf", "RR_calf"], ["l", "r", "l", "r"]),
        (["LF_SHANK", "RF_SHANK", "LH_SHANK", "RH_SHANK"], ["l", "r", "l", "r"]),
        (["LF", "LM", "LR", "RF", "RM", "RR"], ["l", "l", "l", "r", "r", "r"]),
        (["leftFoot", "RIGHT_FOOT_LINK"], ["l", "r"]),
        (["l_ankle_2", "r_ankle_2"], ["l", "r"]),
        (["RL", "RR"], ["", ""]),  # rear left or right left
        (["leg_1", "leg_2"], ["", ""]),
    ):
        assert side_letters(names) == sides


def test_a_base_with_left_legs_on_its_right_is_turned_with_a_note(tmp_path: Path) -> None:
    machine, guesses = build_machine(read(tmp_path, renamed(BIPED_MJCF)), "m")
    assert "-x axis pointing forward" in guesses[0]
    assert "--forward x" in guesses[0]
    assert "its x axis pointing forward, z up" in build_machine(read(tmp_path, BIPED_MJCF), "m")[1][0]
    kept, guesses = build_machine(read(tmp_path, renamed(BIPED_MJCF)), "m", forward="x")
    assert "its x axis" in guesses[0]
    turned_link, kept_link = (
        next(li for li in m.links if li.name == "left_hip_link") for m in (machine, kept)
    )
    assert turned_link.position == pytest.approx(kept_link.position * [-1.0, -1.0, 1.0])
    assert machine.links[0].centre == pytest.approx(kept.links[0].centre * [-1.0, -1.0, 1.0])


def test_a_file_whose_y_axis_points_up(tmp_path: Path) -> None:
    """Without the option no limb is below the base.

    With the option the machine equals that of the file with z up.
    """
    upright = read(tmp_path, BIPED_MJCF)
    lying = with_base_axes(upright, base_of(upright.model), "x", "-y")
    with pytest.raises(UserError, match="--up"):
        build_machine(lying, "m")
    machine, guesses = build_machine(lying, "m", forward="x", up="y")
    assert "y up" in guesses[0]
    for new_axes, expected in (
        (("z", "y"), "y axis pointing forward, x up"),
        (("y", "x"), "z axis pointing forward, y up"),
    ):
        rotated = with_base_axes(upright, base_of(upright.model), *new_axes)
        assert f"its {expected}" in build_machine(rotated, "m", up=expected[-4])[1][0]
    for link, expected in zip(machine.links, build_machine(upright, "m")[0].links, strict=True):
        assert link.position == pytest.approx(expected.position, abs=1e-9)
        assert link.inertia == pytest.approx(expected.inertia, abs=1e-9)


def test_forward_and_up_are_two_axes(tmp_path: Path) -> None:
    with pytest.raises(UserError):
        build_machine(read(tmp_path, BIPED_MJCF), "m", forward="-y", up="y")
