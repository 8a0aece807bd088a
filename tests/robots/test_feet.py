"""Geoms of another maker's model that are the feet."""

from collections.abc import Callable

import mujoco
import numpy as np
from made_up import SOLES

from footfall import Robot
from footfall.robots.feet import find_feet
from footfall.robots.mjcf import load_spec

SPHERE = mujoco.mjtGeom.mjGEOM_SPHERE
REAR_RIGHT = 2  # among go1's feet


def without_a_name(
    robot: Robot, change: Callable[[mujoco.MjsGeom], None]
) -> tuple[mujoco.MjModel, tuple[np.ndarray, ...]]:
    """The robot's model without the rear right foot's name, as other makers may write it, and its feet."""
    spec = load_spec(robot.xml_path)
    foot = spec.geom(robot.description.feet[REAR_RIGHT].geoms[0])
    foot.name = ""
    change(foot)
    model = spec.compile()
    return model, find_feet(model, robot.description, robot.xml_path)


def test_a_foot_on_a_link_that_is_fixed_to_the_shin_is_found_by_its_position(go1: Robot) -> None:
    def move_to_toe(foot: mujoco.MjsGeom) -> None:
        toe = foot.parent.add_body(name="toe", pos=foot.pos)
        toe.add_geom(type=SPHERE, size=foot.size, contype=1)
        foot.pos[:] = 0.0  # at the shin's upper end: no foot

    model, feet = without_a_name(go1, move_to_toe)
    assert [model.body(model.geom_bodyid[geom]).name for geom in feet[REAR_RIGHT]] == ["toe"]


def test_a_foot_without_a_name_is_found_among_the_others(go1: Robot) -> None:
    model, feet = without_a_name(go1, lambda foot: None)
    names = [model.geom(int(geoms[0])).name for geoms in feet]
    assert [bool(name) for name in names] == [True, True, False, True]
    assert model.geom_type[feet[REAR_RIGHT]] == SPHERE


def test_a_geom_without_collisions_is_no_foot(go1: Robot) -> None:
    """A visual cap is at the expected position of the foot; the foot itself is 1 cm away."""

    def cap(foot: mujoco.MjsGeom) -> None:
        foot.parent.add_geom(type=SPHERE, size=[0.03, 0, 0], pos=foot.pos, contype=0, conaffinity=0)
        foot.pos[0] += 0.01

    model, feet = without_a_name(go1, cap)
    (found,) = feet[REAR_RIGHT].tolist()
    assert model.geom_contype[found] or model.geom_conaffinity[found]


def test_one_box_may_serve_for_four_corners_and_counts_once(bodies: dict[str, Robot]) -> None:
    robot = bodies[SOLES]
    corners = robot.description.feet[0].geoms
    assert len(corners) == 4
    spec = load_spec(robot.xml_path)
    spheres = [spec.geom(name) for name in corners]
    centres = np.array([sphere.pos for sphere in spheres])
    middle, half = centres.mean(axis=0), np.ptp(centres, axis=0) / 2 + spheres[0].size[0]
    link = spheres[0].parent
    for sphere in spheres:
        spec.delete(sphere)
    link.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=middle)
    link.add_geom(type=SPHERE, size=[0.03, 0, 0])  # the ankle's housing, farther from each corner
    model = spec.compile()
    (sole,) = find_feet(model, robot.description, robot.xml_path)[0].tolist()
    assert model.geom_type[sole] == mujoco.mjtGeom.mjGEOM_BOX
