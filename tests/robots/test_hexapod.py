"""The gaits of the hexapod: mirror images and stability."""

from itertools import combinations

import numpy as np
import pytest

from footfall.policies.gaits import find_gait
from footfall.robots.description import load_robot
from footfall.robots.support import support_margin
from footfall.robots.symmetry import find_symmetry

ROBOT = load_robot("hexapod")
FEET = [foot.name for foot in ROBOT.description.feet]
TRIPODS = {frozenset({"LF", "RM", "LR"}), frozenset({"RF", "LM", "RR"})}


@pytest.mark.parametrize("name", ["tripod", "ripple", "wave"])
def test_the_mirror_image_of_its_gaits_is_half_a_cycle_later(name: str) -> None:
    symmetry = find_symmetry(ROBOT, find_gait(name, ROBOT).phase)
    assert symmetry.clock == -1.0
    assert [FEET[k] for k in symmetry.feet] == ["RF", "RM", "RR", "LF", "LM", "LR"]


def lifted(name: str) -> set[frozenset[str]]:
    """Which feet are in the air together in the course of a gait."""
    gait = find_gait(name, ROBOT)
    found = set()
    for clock in np.arange(0.002, 1.0, 0.004):
        up = (clock + gait.phase) % 1.0 >= gait.duty
        found.add(frozenset(foot for foot, swings in zip(FEET, up, strict=True) if swings))
    return found - {frozenset()}


def margin(feet: frozenset[str]) -> float:
    """Of the body's centre over feet that stand in their default places."""
    places = [tuple(ROBOT.foot_places[FEET.index(foot), :2].tolist()) for foot in feet]
    return support_margin(places, (0.0, 0.0))


def test_of_all_ways_to_stand_on_three_feet_and_three_only_the_tripods_keep_the_centre_inside() -> None:
    assert lifted("tripod") == TRIPODS
    for three in map(frozenset, combinations(FEET, 3)):
        other = frozenset(FEET) - three
        least = min(margin(three), margin(other))
        if {three, other} == TRIPODS:
            assert least == pytest.approx(0.127, abs=1e-3)
        else:
            assert least < 1e-9, f"{set(three)} and {set(other)}: on an edge, or outside"
