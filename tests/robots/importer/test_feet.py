"""Feet of an imported robot: spheres, soles and their names."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.robots.importer.feet import is_sole, leg_names, stand_on
from footfall.robots.importer.limbs import Limb
from footfall.robots.importer.machine import Geom, Link
from footfall.robots.importer.shapes import Kind, Shape, support


def test_legs_are_named_by_the_part_of_the_name_that_differs() -> None:
    for ends, names in (
        (["FL_calf", "FR_calf"], ["FL", "FR"]),
        (["leg_left_6_link", "leg_right_6_link"], ["left", "right"]),
        (["a", "b_c"], ["a", "b_c"]),
    ):
        assert leg_names(ends) == names


UP = np.array([0.0, 0.0, 1.0])
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
PLACE = np.array([0.3, -0.2, 0.5])


def turned(*angles: float) -> np.ndarray:
    """Quaternion w x y z of turns about the fixed x, y and z."""
    return Rotation.from_euler("xyz", angles).as_quat(scalar_first=True)


def geom(name: str, kind: mujoco.mjtGeom, size: Sequence[float], at: Sequence[float], **rest: Any) -> Geom:
    sizes = np.zeros(3)
    sizes[: len(size)] = size
    shape = Shape(kind, sizes, np.array(at, dtype=float), rest.pop("turn", LEVEL))
    return Geom(name, shape, 0.7, 1, 1, **{"of_body": "shank", **rest})


def foot_of(
    *geoms: Geom, up: np.ndarray = UP, joints: int = 3, feet: Sequence[str] = ()
) -> tuple[list[Geom], list[Geom]]:
    """Contact geoms of a link's foot, and its other geoms."""
    link = Link("shank", 1, np.zeros(3), LEVEL, 1.0, np.zeros(3), np.eye(3), (), geoms)
    limb = Limb(tuple(f"j{k}" for k in range(joints)), (4,), frozenset(feet))
    made, leg = stand_on(link, 2, limb, limb.joints[1:], "FL", up)
    assert (leg.name, leg.joints, leg.link) == ("FL", limb.joints[1:], 2)
    return [g for g in made.geoms if g.name in leg.geoms], [g for g in made.geoms if g.name not in leg.geoms]


def sphere(name: str, low: float, radius: float = 0.02, x: float = 0.0, **rest: Any) -> Geom:
    """A sphere whose lowest point is at a height."""
    return geom(name, Kind.mjGEOM_SPHERE, [radius], [x, 0.0, low + radius], **rest)


def test_spheres_that_are_level_within_a_centimetre_touch_together() -> None:
    feet, others = foot_of(sphere("a", -0.2), sphere("b", -0.192, 0.03, 0.1), sphere("c", -0.188, 0.01, -0.1))
    assert [g.name for g in feet] == ["FL_foot_1", "FL_foot_2"]
    assert [g.shape.size[0] for g in feet] == [0.02, 0.03]
    assert [g.name for g in others] == ["c"]


def test_capsules_along_the_ground_become_spheres_at_the_corners_of_their_outline() -> None:
    """The capsules are 0.2, 0.24 and 0.2 m long, side by side and 12 mm thick.

    Only a leg with an ankle has soles.
    """
    ahead = turned(0.0, np.pi / 2, 0.0)
    rods = [
        geom(f"rod {y}", Kind.mjGEOM_CAPSULE, [0.012, half], [0.03, y, 0.012], turn=ahead)
        for y, half in ((-0.03, 0.1), (0.0, 0.12), (0.03, 0.1))
    ]
    feet, others = foot_of(*rods, joints=6)
    assert sorted(tuple(g.shape.position.round(6)) for g in feet) == [
        (x, y, 0.012) for x in (-0.07, 0.13) for y in (-0.03, 0.03)
    ]
    assert all(g.shape.kind == Kind.mjGEOM_SPHERE and g.shape.size[0] == 0.012 for g in feet)
    assert [g.shape.position[2] - g.shape.size[0] for g in others] == pytest.approx([0.006] * 3)
    assert len(foot_of(*rods, joints=3)[0]) == 1


def test_a_sole_leans_by_at_most_14_deg() -> None:
    for size, lean, flat in (
        ((0.1, 0.05, 0.02), 0.2, True),
        ((0.1, 0.05, 0.02), 0.3, False),
        ((0.02, 0.05, 0.1), np.pi / 2, True),
        ((0.1, 0.05, 0.06), 0.0, False),
    ):
        shape = Shape(Kind.mjGEOM_BOX, np.array(size), PLACE, turned(0.0, lean, 0.0))
        assert bool(is_sole(shape, UP)) is flat
        assert not is_sole(shape._replace(kind=Kind.mjGEOM_ELLIPSOID), UP)


@pytest.mark.parametrize("way", [0.0, np.pi])
def test_a_rod_is_shortened_by_the_sphere_at_its_end(way: float) -> None:
    """A rod of radius 0.03 m extends from 0.03 m above the joint to 0.23 m below, in either direction."""
    rod = geom("rod", Kind.mjGEOM_CAPSULE, [0.03, 0.1], [0.0, 0.0, -0.1], turn=turned(way, 0.0, 0.0))
    feet, others = foot_of(rod)
    assert (feet[0].shape.kind, feet[0].shape.size[0]) == (Kind.mjGEOM_SPHERE, 0.03)
    np.testing.assert_allclose(feet[0].shape.position, [0.0, 0.0, -0.2], atol=1e-9)
    rest = others[0].shape
    ends = rest.position[2] + np.array([-1.0, 1.0]) * (rest.size[1] + rest.size[0])
    assert ends == pytest.approx([-0.2, 0.03])


def test_a_tall_box_ends_in_a_sphere_as_wide_as_its_narrow_side() -> None:
    feet, others = foot_of(geom("box", Kind.mjGEOM_BOX, [0.03, 0.02, 0.1], [0.1, 0.0, -0.1]))
    assert feet[0].shape.size[0] == 0.02
    np.testing.assert_allclose(feet[0].shape.position, [0.1, 0.0, -0.18], atol=1e-9)
    assert others[0].shape.size.tolist() == pytest.approx([0.03, 0.02, 0.09])
    assert others[0].shape.position[2] == pytest.approx(-0.09)


def test_a_rod_that_is_short_or_lies_along_the_ground_is_left_out() -> None:
    lying = geom("rod", Kind.mjGEOM_CAPSULE, [0.02, 0.1], [0.0, 0.0, -0.1], turn=turned(0.0, 1.4, 0.0))
    short = geom("rod", Kind.mjGEOM_CAPSULE, [0.03, 0.01], [0.0, 0.0, -0.1])
    for each in (lying, short):
        feet, others = foot_of(each)
        assert len(feet) == 1
        assert others == []


@pytest.mark.parametrize(("joints", "corners"), [(4, 1), (5, 4)])
def test_a_mesh_becomes_a_sole_where_an_ankle_can_hold_it_level(joints: int, corners: int) -> None:
    points = np.array([[x, y, z] for x in (-0.05, 0.15) for y in (-0.04, 0.04) for z in (-0.1, 0.0)])
    shoe = replace(geom("shoe", Kind.mjGEOM_ELLIPSOID, [0.1, 0.04, 0.05], [0.05, 0, -0.05]), points=points)
    feet, _ = foot_of(shoe, joints=joints)
    assert len(feet) == corners
    assert all(g.shape.position[2] - support(g.shape, UP) == pytest.approx(-0.1) for g in feet)
