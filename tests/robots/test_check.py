"""`footfall robot check`: a robot's figures, and whether it stands."""

import re
import shutil
from pathlib import Path

import pytest
from edited import edit
from foreign_robots import BALL, quadruped
from shell import Shell

from footfall import Robot, load_robot
from footfall.plant.standing import standing_test
from footfall.robots.importer.create import Imported
from footfall.robots.inspection import inspect_robot


@pytest.fixture
def folder(four: tuple[Robot, Imported], tmp_path: Path) -> Path:
    """A copy of an imported quadruped, free to be changed."""
    return shutil.copytree(four[0].folder, tmp_path / "changed")


def change(path: Path, old: str, new: str) -> None:
    """Replace each match of a pattern in a file; there must be one."""
    text, count = re.subn(old, new, path.read_text())
    assert count
    path.write_text(text)


def wrong(shell: Shell, folder: Path, seconds: int = 1) -> str:
    """The faults found by the check, which must end with status 1."""
    status, out, _ = shell("robot", "check", folder, "--duration", str(seconds), "--no-controllers")
    assert status == 1
    return "\n".join(line for line in out.splitlines() if line.startswith("wrong: "))


def test_an_imported_quadruped_stands_on_all_feet_unless_its_knees_are_weak(folder: Path) -> None:
    found = standing_test(load_robot(folder), duration_s=0.8)
    assert found.stood
    assert found.stood_s == pytest.approx(0.8, abs=0.01)
    assert (found.feet_down == 1.0).all()
    change(folder / "robot.yaml", r"(peak|stall)_torque_nm: 23", r"\1_torque_nm: 1")
    found = standing_test(load_robot(folder), duration_s=0.8)
    assert not found.stood
    assert "the base has sunk" in found.faults[0]
    change(
        folder / "robot.yaml", r"\Z", "\nsafety: {sensors: {sunk: 1.0}}\n"
    )  # the base may sink to the ground
    found = standing_test(load_robot(folder), duration_s=0.8)
    assert found.sank_m > 0.1
    assert found.torque_share.reshape(4, 3).max(axis=0) == pytest.approx([0.1, 0.2, 1.0], abs=0.15)


LARGE_HIPS = r'\1<geom type="sphere" size="0.13" pos="0 0 0.02"/>'
LOW_TRUNK = r'\1<geom type="sphere" size="0.1" pos="0 0 -0.3"/>'


@pytest.mark.parametrize(
    ("file", "old", "new", "finding"),
    [
        # A knee bent by half a radian more.
        (
            "robot.yaml",
            r"(RL_knee, .*?default_rad: )(-[\d.]+)",
            r"\1-1.9",
            r"foot RL is [1-9]\d mm above the",
        ),
        ("robot.xml", r'(<joint name="F[LR]_hip"[^>]*>)', LARGE_HIPS, "links FL_thigh and FR_thigh collide"),
        ("robot.xml", r'(<freejoint name="floating_base"/>)', LOW_TRUNK, "link trunk touches the ground"),
        (
            "robot.xml",
            r'(<inertial mass="6.6" pos=")[-\d.e]+',
            r"\g<1>0.9",
            "the centre of mass is not above",
        ),
    ],
)
def test_defects_of_a_robot_are_found(folder: Path, file: str, old: str, new: str, finding: str) -> None:
    change(folder / file, old, new)
    assert any(re.match(finding, each) for each in inspect_robot(load_robot(folder)).findings())


def test_a_biped_on_points(tmp_path: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """The check supports the biped at first. Without support the check finds that the biped falls."""
    (tmp_path / "m.urdf").write_text(quadruped(foot=BALL))
    monkeypatch.setattr("footfall.plant.lying.find_lying_pose", lambda _: None)  # takes seconds
    made = shell("robot", "new", "--from", "m.urdf", "--out", "two", "--feet", "FL_shank,FR_shank")
    assert made.status == 0
    assert "the robot cannot stand by joint stiffness alone" in made.out
    falls = "wrong: the robot does not stand"
    assert falls not in wrong(shell, tmp_path / "two", 3)
    edit(tmp_path / "two", "robot.yaml", "held_start: true", "")
    assert falls in wrong(shell, tmp_path / "two", 3)


def test_motors_near_their_limit_are_reported(folder: Path, shell: Shell) -> None:
    """The knees have little more torque than the weight requires."""
    change(folder / "robot.yaml", r"(peak|stall)_torque_nm: 23", r"\1_torque_nm: 3.4")
    assert re.search(r"joint \w+_knee needs \d+ % of its peak torque", wrong(shell, folder, 2))


def test_gains_that_are_too_high_are_reported(folder: Path, shell: Shell) -> None:
    """A reflected inertia of 0.3 kg m^2 at 5 Hz has kd = 2 * 0.3 * 2 pi * 5 = 18.8 N m s/rad."""
    change(folder / "robot.xml", r'armature="[\d.]+"', 'armature="0.3"')
    change(folder / "robot.yaml", r"natural_frequency_hz: [\d.]+", "natural_frequency_hz: 5")
    assert "FL_roll: kd is 18.8" in wrong(shell, folder)


def test_settings_with_which_no_training_and_no_run_can_begin_are_refused(folder: Path, shell: Shell) -> None:
    change(folder / "robot.yaml", r"\Z", "\nsafety: {tilt_limit_rad: .nan}\n")
    assert "tilt_limit_rad" in shell.refuses("robot", "check", folder)
    assert "tilt_limit_rad" in shell.refuses("train", "--robot", folder, "--preset", "smoke")
    change(folder / "robot.yaml", r"safety.*", "")
    (folder / "randomisation.yaml").write_text("armature: {low: 1.05, high: 0.95}")
    assert "armature" in shell.refuses("robot", "check", folder)
