"""Figures of `inspect_robot`, on a robot that can be calculated by hand."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from edited import edit
from made_up import PITCH, SOLE, Hinge, Leg, write_robot

from footfall.robots.description import Robot, load_robot
from footfall.robots.inspection import Inspection, inspect_robot


def straight(name: str, y: float, length: float) -> Leg:
    """Two links that hang down and end in a sole: four spheres 0.1 m ahead, 0.04 m behind, 0.03 m aside."""
    hinges = Hinge(PITCH, (0.0, 0.0, -length), 0.0), Hinge(PITCH, (0.0, 0.0, -0.2), 0.0)
    return Leg(name, (0.03, y, 0.0), hinges, SOLE)


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    """A robot with a base of 4 kg; one leg is 8 mm shorter than the other."""
    return write_robot(tmp_path_factory.mktemp("two"), [straight("l", 0.1, 0.2), straight("r", -0.12, 0.192)])


@pytest.fixture
def copy(robot: Robot, tmp_path: Path) -> Path:
    """A copy of the robot's folder, which a test may change."""
    shutil.copytree(robot.folder, tmp_path / "copy")
    return tmp_path / "copy"


@pytest.fixture(scope="module")
def looked(robot: Robot) -> Inspection:
    return inspect_robot(robot)


def test_masses_are_those_of_all_links(looked: Inspection) -> None:
    """A leg has two rods of 0.15 kg and four spheres of 0.02 kg, which are 0.03 m ahead of the ankle."""
    assert looked.mass_kg == pytest.approx(4.0 + 2 * (0.3 + 0.08))
    ahead = 2 * (0.3 * 0.03 + 0.08 * 0.06) / 4.76
    aside = 0.38 * (0.1 - 0.12) / 4.76
    left = 0.15 * 0.1 + 0.15 * 0.3 + 0.08 * 0.415
    right = 0.15 * 0.096 + 0.15 * 0.292 + 0.08 * 0.407
    np.testing.assert_allclose(looked.centre_m, [ahead, aside, -(left + right) / 4.76], atol=1e-9)


@pytest.mark.parametrize("off_m", [-0.004, 0.004])
def test_a_foot_in_the_air_is_found_at_any_height(robot: Robot, copy: Path, off_m: float) -> None:
    height = robot.description.standing_height_m
    declaration = (robot.folder / "robot.yaml").read_text()
    assert f"standing_height_m: {height}\n" in declaration
    changed = declaration.replace(f"standing_height_m: {height}\n", f"standing_height_m: {height + off_m}\n")
    (copy / "robot.yaml").write_text(changed)
    gaps = [foot.gap_m for foot in inspect_robot(load_robot(copy)).feet]
    assert gaps == pytest.approx([0.0, 0.008], abs=1e-9)


def test_the_margin_is_to_the_edge_of_all_corners(looked: Inspection) -> None:
    """The heels are 0.01 m behind the base's origin; the centre of mass is 5.8 mm ahead of it."""
    assert looked.margin_m == pytest.approx(0.01 + 2 * (0.3 * 0.03 + 0.08 * 0.06) / 4.76)


def test_the_reach_is_of_the_soles_middle_over_the_joints_whole_range(looked: Inspection) -> None:
    """The thigh is 0.2 m long, the sole's middle 0.215 m below and 0.03 m ahead.

    Knees bend by 1.6 rad in both directions.
    """
    shank, slant = np.hypot(0.03, 0.215), np.arctan2(0.03, 0.215)
    near, far = looked.feet[0].reach_m
    assert far == pytest.approx(0.2 + shank, abs=1e-3)
    law_of_cosines = 0.04 + shank**2 + 2 * 0.2 * shank * np.cos(1.6 + slant)
    assert near == pytest.approx(np.sqrt(law_of_cosines), abs=1.5e-3)


def test_the_tree_has_the_robots_bodies_only(copy: Path) -> None:
    crate = '<body name="crate" pos="3 0 1"><freejoint/><geom size="0.1"/></body></worldbody>'
    edit(copy, "robot.xml", "</worldbody>", crate)
    rows = inspect_robot(load_robot(copy)).links
    assert [row.depth for row in rows] == [0, 1, 2, 3, 1, 2, 3]
    assert [row.joints for row in rows] == [(), ("l0",), ("l1",), (), ("r0",), ("r1",), ()]
    assert rows[0].mass_kg == pytest.approx(4.0)
