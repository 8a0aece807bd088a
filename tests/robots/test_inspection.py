"""Figures of `inspect_robot`, on a robot that can be calculated by hand."""

from pathlib import Path

import numpy as np
import pytest
from edited import edit
from made_up import PITCH, SOLE, Hinge, Leg, write_robot

from footfall import Robot, load_robot
from footfall.robots.inspection import inspect_robot


def straight(name: str, y: float, length: float) -> Leg:
    """Two links that hang down and end in a sole: four spheres 0.1 m ahead, 0.04 m behind, 0.03 m aside."""
    hinges = Hinge(PITCH, (0.0, 0.0, -length), 0.0), Hinge(PITCH, (0.0, 0.0, -0.2), 0.0)
    return Leg(name, (0.03, y, 0.0), hinges, SOLE)


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    """A robot with a base of 4 kg; one leg is 8 mm shorter than the other."""
    return write_robot(tmp_path, [straight("l", 0.1, 0.2), straight("r", -0.12, 0.192)])


def test_masses_margin_and_reach_are_those_calculated_by_hand(robot: Robot) -> None:
    """A leg has two rods of 0.15 kg and four spheres of 0.02 kg, which are 0.03 m ahead of the ankle."""
    found = inspect_robot(robot)
    assert found.mass_kg == pytest.approx(4.0 + 2 * (0.3 + 0.08))
    ahead = 2 * (0.3 * 0.03 + 0.08 * 0.06) / 4.76
    aside = 0.38 * (0.1 - 0.12) / 4.76
    left = 0.15 * 0.1 + 0.15 * 0.3 + 0.08 * 0.415
    right = 0.15 * 0.096 + 0.15 * 0.292 + 0.08 * 0.407
    np.testing.assert_allclose(found.centre_m, [ahead, aside, -(left + right) / 4.76], atol=1e-9)
    assert found.margin_m == pytest.approx(0.01 + ahead)  # the heels are 0.01 m behind the base's origin
    # The thigh is 0.2 m long, the sole's middle 0.215 m below the knee and 0.03 m ahead of it.
    below_knee, slant = np.hypot(0.03, 0.215), np.arctan2(0.03, 0.215)
    near, far = found.feet[0].reach_m
    assert far == pytest.approx(0.2 + below_knee, abs=1e-3)
    # Law of cosines, for a knee that bends by 1.6 rad.
    near_sq = 0.04 + below_knee**2 + 2 * 0.2 * below_knee * np.cos(1.6 + slant)
    assert near == pytest.approx(np.sqrt(near_sq), abs=1.5e-3)


@pytest.mark.parametrize("off_m", [-0.004, 0.004])
def test_a_foot_in_the_air_is_found_at_any_height(robot: Robot, off_m: float) -> None:
    height = robot.description.standing_height_m
    edit(robot.folder, "robot.yaml", f"height_m: {height}\n", f"height_m: {height + off_m}\n")
    gaps = [foot.gap_m for foot in inspect_robot(load_robot(robot.folder)).feet]
    assert gaps == pytest.approx([0.0, 0.008], abs=1e-9)


def test_the_tree_has_the_robots_bodies_only(robot: Robot) -> None:
    crate = '<body name="crate" pos="3 0 1"><freejoint/><geom size="0.1"/></body></worldbody>'
    edit(robot.folder, "robot.xml", "</worldbody>", crate)
    rows = inspect_robot(load_robot(robot.folder)).links
    assert [row.depth for row in rows] == [0, 1, 2, 3, 1, 2, 3]
    assert [row.joints for row in rows] == [(), ("l0",), ("l1",), (), ("r0",), ("r1",), ()]
    assert rows[0].mass_kg == pytest.approx(4.0)
