"""`footfall robot check`: a robot's figures, and whether it stands."""

import math
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from edited import content_of, edit
from foreign_robots import BALL, quadruped
from shell import Shell

from footfall.cli import main
from footfall.plant.standing import StandingResult, standing_test
from footfall.robots.description import Robot, load_robot
from footfall.robots.importer.create import Imported
from footfall.robots.inspection import inspect_robot


@pytest.fixture(scope="module")
def dog(four: tuple[Robot, Imported]) -> Robot:
    return four[0]


@pytest.fixture(scope="module")
def dog_standing(dog: Robot) -> StandingResult:
    return standing_test(dog, duration_s=1.5)


BASE_MAY_TOUCH = "\nsafety: {sensors: {sunk: 1.0}}\n"  # a robot that may have its base on the ground


@pytest.fixture
def changed(dog: Robot, tmp_path: Path) -> Callable[..., Path]:
    """A copy of the quadruped in which one text of one file is replaced."""

    def change(file: str, old: str, new: str) -> Path:
        folder = tmp_path / "changed"
        if not folder.exists():
            folder.mkdir()
            for path in dog.folder.iterdir():
                (folder / path.name).write_text(path.read_text())
        text = (folder / file).read_text()
        found = re.sub(old, new, text)
        assert found != text
        (folder / file).write_text(found)
        return folder

    return change


def wrong(folder: Path, capsys: pytest.CaptureFixture[str], seconds: str = "1") -> str:
    """The faults found by the check, which must end with status 1."""
    assert main(["robot", "check", str(folder), "--duration", seconds, "--no-controllers"]) == 1
    return "\n".join(line for line in capsys.readouterr().out.splitlines() if line.startswith("wrong: "))


def test_an_imported_quadruped_stands_on_all_feet(dog_standing: StandingResult) -> None:
    assert dog_standing.stood
    assert dog_standing.stood_s == pytest.approx(1.5, abs=0.01)
    assert (dog_standing.feet_down == 1.0).all()


def test_a_robot_with_weak_knees_does_not_stand(changed: Callable[..., Path]) -> None:
    folder = changed("robot.yaml", r"(peak|stall)_torque_nm: 23", r"\1_torque_nm: 1")
    found = standing_test(load_robot(folder), duration_s=1.5)
    assert not found.stood
    assert "the base has sunk" in found.faults[0]
    changed("robot.yaml", r"\Z", BASE_MAY_TOUCH)
    found = standing_test(load_robot(folder), duration_s=1.5)
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
            r"foot RL is [1-9]\d mm above the ground",
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
def test_defects_of_a_robot_are_found(
    changed: Callable[..., Path], file: str, old: str, new: str, finding: str
) -> None:
    findings = inspect_robot(load_robot(changed(file, old, new))).findings()
    assert any(re.match(finding, each) for each in findings)


def test_a_biped_on_points(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The check supports the biped at first. Without support the check finds that the biped falls."""
    (tmp_path / "m.urdf").write_text(quadruped(foot=BALL))
    arguments = ["--from", str(tmp_path / "m.urdf"), "--out", str(tmp_path / "two")]
    monkeypatch.setattr("footfall.plant.lying.find_lying_pose", lambda _: None)  # takes seconds
    assert main(["robot", "new", *arguments, "--feet", "FL_shank,FR_shank"]) == 0
    assert "the robot cannot stand by joint stiffness alone" in capsys.readouterr().out
    falls = "wrong: the robot does not stand"
    assert falls not in wrong(tmp_path / "two", capsys, "3")
    edit(tmp_path / "two", "robot.yaml", "held_start: true", "")
    assert falls in wrong(tmp_path / "two", capsys, "3")


def test_motors_near_their_limit_are_reported(
    changed: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """The knees have little more torque than the weight requires."""
    folder = changed("robot.yaml", r"(peak|stall)_torque_nm: 23", r"\1_torque_nm: 3.4")
    assert re.search(r"joint \w+_knee needs \d+ % of its peak torque", wrong(folder, capsys, "2"))


def test_gains_that_are_too_high_are_reported(
    changed: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    """A reflected inertia of 0.3 kg m^2 at 5 Hz has kd = 2 * 0.3 * 2 pi * 5 = 18.8 N m s/rad."""
    changed("robot.xml", r'armature="[\d.]+"', 'armature="0.3"')
    folder = changed("robot.yaml", r"natural_frequency_hz: [\d.]+", "natural_frequency_hz: 5")
    assert "FL_roll: kd is 18.8" in wrong(folder, capsys)


def test_settings_with_which_no_training_and_no_run_can_begin_are_refused(
    dog: Robot, tmp_path: Path, shell: Shell
) -> None:
    folder = tmp_path / "mine"
    shutil.copytree(dog.folder, folder)
    before = (folder / "randomisation.yaml").read_text()
    (folder / "randomisation.yaml").write_text("armature: {low: 1.05, high: 0.95}")
    assert "armature" in shell.refuses("robot", "check", str(folder))
    (folder / "randomisation.yaml").write_text(before)
    with content_of(folder / "robot.yaml") as content:
        content["safety"] = {"tilt_limit_rad": math.nan}
    assert "tilt_limit_rad" in shell.refuses("robot", "check", str(folder))
    assert "tilt_limit_rad" in shell.refuses("train", "--robot", str(folder), "--preset", "smoke")
