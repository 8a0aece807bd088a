"""The hexapod that ships with footfall: its figures, its buses, and why its tripods are what they are."""

from itertools import combinations

import mujoco
import numpy as np
import pytest

from footfall.policies.gaits import find_gait
from footfall.robots.description import load_robot
from footfall.robots.model import plant_model
from footfall.robots.support import support_margin
from footfall.robots.symmetry import find_symmetry

ROBOT = load_robot("hexapod")
FEET = [foot.name for foot in ROBOT.description.feet]
TRIPODS = {frozenset({"LF", "RM", "LR"}), frozenset({"RF", "LM", "RR"})}


def test_its_links_are_as_long_as_given() -> None:
    model = plant_model(ROBOT)
    for foot in ROBOT.description.feet:
        coxa, femur, tibia = (model.joint(name).bodyid[0] for name in foot.joints)
        assert np.linalg.norm(model.body_pos[femur]) == pytest.approx(0.05), "coxa"
        assert np.linalg.norm(model.body_pos[tibia]) == pytest.approx(0.10), "femur"
        assert np.linalg.norm(model.geom(foot.geoms[0]).pos) == pytest.approx(0.22), "tibia"
        assert model.geom(foot.geoms[0]).size[0] == 0.02
        assert model.body_parentid[coxa] == model.body(ROBOT.description.base).id
    assert model.body_mass.sum() == pytest.approx(1.45 + 6 * 0.26)


def test_its_feet_stand_beyond_the_femur_joints_with_the_body_at_its_height() -> None:
    model = plant_model(ROBOT)
    data = mujoco.MjData(model)
    data.qpos[:7] = (0, 0, ROBOT.description.standing_height_m, 1, 0, 0, 0)
    data.qpos[7:] = ROBOT.default_pose
    mujoco.mj_kinematics(model, data)
    assert ROBOT.description.standing_height_m == 0.2
    for foot in ROBOT.description.feet:
        femur = data.xanchor[model.joint(foot.joints[1]).id]
        beyond = data.geom(foot.geoms[0]).xpos - femur
        assert np.hypot(*beyond[:2]) == pytest.approx(0.12, abs=1e-3)
        assert beyond[2] == pytest.approx(-0.18, abs=1e-3)


def test_three_buses_carry_six_motors_each_within_the_joints_rate() -> None:
    buses = [joint.bus for joint in ROBOT.description.joints]
    assert {bus: buses.count(bus) for bus in set(buses)} == {"can0": 6, "can1": 6, "can2": 6}
    assert ROBOT.description.imu_bus not in buses
    assert ROBOT.description.target_rate_rad_s == 3.0
    assert np.all(ROBOT.motor.no_load_speed > 3.0)


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
