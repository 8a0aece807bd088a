"""Primitive shapes fitted to points, and the feet of an imported robot: spheres, soles and their names."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.robots.importer import shapes
from footfall.robots.importer.feet import is_sole, leg_names, stand_on
from footfall.robots.importer.limbs import Limb
from footfall.robots.importer.machine import Geom, Link
from footfall.robots.importer.pose import lowest_height
from footfall.robots.importer.shapes import Kind, Shape, fit_along, fit_shape, rotation_of, support

UP = np.array([0.0, 0.0, 1.0])
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
TURN = Rotation.from_euler("xyz", [0.4, -0.7, 1.1])
PLACE = np.array([0.3, -0.2, 0.5])


def surface(kind: mujoco.mjtGeom, size: Sequence[float]) -> np.ndarray:
    """Points all over a primitive about the origin, (k, 3)."""
    rng = np.random.default_rng(2)
    sphere = rng.normal(size=(200_000, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    match kind:
        case Kind.mjGEOM_SPHERE:
            return size[0] * sphere
        case Kind.mjGEOM_CAPSULE:
            return size[0] * sphere + np.outer(np.sign(sphere[:, 2]) * size[1], UP)
        case Kind.mjGEOM_CYLINDER:
            rim = sphere[:, :2] / np.linalg.norm(sphere[:, :2], axis=1, keepdims=True)
            return np.column_stack([size[0] * rim, np.sign(sphere[:, 2]) * size[1]])
        case Kind.mjGEOM_ELLIPSOID:
            return np.array(size) * sphere
    return np.array(size) * np.sign(sphere)


def test_a_shape_reaches_to_its_surface() -> None:
    for kind, size in (
        (Kind.mjGEOM_SPHERE, (0.07, 0.0, 0.0)),
        (Kind.mjGEOM_CAPSULE, (0.03, 0.1, 0.0)),
        (Kind.mjGEOM_CYLINDER, (0.05, 0.1, 0.0)),
        (Kind.mjGEOM_ELLIPSOID, (0.03, 0.06, 0.1)),
        (Kind.mjGEOM_BOX, (0.03, 0.06, 0.1)),
    ):
        shape = Shape(kind, np.array(size), PLACE, TURN.as_quat(scalar_first=True))
        points = TURN.apply(surface(kind, size)) + PLACE
        for up in ([0.8, 0.36, 0.48], [-0.8, -0.36, -0.48]):
            assert support(shape, up) == pytest.approx(((points - PLACE) @ up).max(), abs=2e-4), kind
            lowest = shapes.lowest_point(shape, up)
            assert lowest @ up == pytest.approx((points @ up).min(), abs=2e-4), kind
            np.testing.assert_allclose(lowest, points[(points @ up).argmin()], atol=3e-3)


def test_a_rod_at_an_angle_is_found() -> None:
    points = TURN.apply(surface(Kind.mjGEOM_CAPSULE, (0.02, 0.1))[:6000]) + PLACE
    shape, _ = fit_shape(points)
    assert shape.kind == Kind.mjGEOM_CAPSULE
    assert shape.size[:2] == pytest.approx([0.02, 0.1], rel=0.03)
    assert abs(rotation_of(shape.quaternion)[:, 2] @ TURN.apply(UP)) == pytest.approx(1.0, abs=1e-3)


def test_a_rotated_box_is_found_along_its_own_axes() -> None:
    shape, _ = fit_shape(TURN.apply(surface(Kind.mjGEOM_BOX, (0.05, 0.1, 0.2))[:500]) + PLACE)
    assert shape.kind == Kind.mjGEOM_BOX
    assert sorted(shape.size) == pytest.approx([0.05, 0.1, 0.2], rel=0.02)
    np.testing.assert_allclose(shape.position, PLACE, atol=1e-3)


def test_a_sole_points_where_the_links_x_axis_does() -> None:
    """A sole of 0.2 by 0.08 m on an ankle that is tilted a little about both axes."""
    frame = Rotation.from_euler("XY", [0.1, 0.3])
    corners = np.array([[x, y, 0.0] for x in (-0.05, 0.15) for y in (-0.04, 0.04)])
    shape = shapes.fit_sole(frame.apply(corners) + PLACE, frame.apply(UP))
    assert shape.size == pytest.approx([0.1, 0.04, 0.01])
    np.testing.assert_allclose(shape.position, frame.apply([0.05, 0.0, 0.01]) + PLACE, atol=1e-9)


def test_a_turned_ellipsoid_is_as_low_as_its_surface() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="ellipsoid" size="0.03 0.06 0.1" pos="0 0 1" euler="40 20 0"/>'
        "</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    points = surface(Kind.mjGEOM_ELLIPSOID, (0.03, 0.06, 0.1)) @ data.geom_xmat[0].reshape(3, 3).T
    assert lowest_height(model, data, 0) == pytest.approx(1.0 + points[:, 2].min(), abs=1e-4)


def test_a_rod_is_found_in_any_direction() -> None:
    turn = np.array([0.8, 0.1, -0.5, 0.3]) / np.linalg.norm([0.8, 0.1, -0.5, 0.3])
    rod = Shape(Kind.mjGEOM_CAPSULE, np.array([0.01, 0.1, 0.0]), np.array([0.02, 0.03, 0.04]), turn)
    axis = rotation_of(turn)[:, 2]
    for direction in (axis, -3.0 * axis):
        found = fit_along([rod], direction)
        assert found.kind == Kind.mjGEOM_CAPSULE
        assert found.size == pytest.approx([0.01, 0.1, 0.0], abs=1e-6)
        assert found.position == pytest.approx(rod.position, abs=1e-6)
        assert abs(rotation_of(found.quaternion)[:, 2] @ axis) == pytest.approx(1.0)


def test_a_rod_with_a_sphere_at_its_end_is_as_thick_as_their_mean() -> None:
    rod = Shape(Kind.mjGEOM_CAPSULE, np.array([0.01, 0.1, 0.0]), np.zeros(3), LEVEL)
    ball = Shape(Kind.mjGEOM_SPHERE, np.array([0.02, 0.0, 0.0]), np.array([0.0, 0.0, -0.1]), LEVEL)
    radius, half_length = fit_along([rod, ball], UP).size[:2]
    assert radius == pytest.approx(0.015, abs=1e-3)
    assert half_length == pytest.approx(0.1, abs=2e-3)


def test_legs_are_named_by_the_part_of_the_name_that_differs() -> None:
    for ends, names in (
        (["FL_calf", "FR_calf"], ["FL", "FR"]),
        (["leg_left_6_link", "leg_right_6_link"], ["left", "right"]),
        (["a", "b_c"], ["a", "b_c"]),
    ):
        assert leg_names(ends) == names


def turned(*angles: float) -> np.ndarray:
    """Quaternion w x y z of turns about the fixed x, y and z."""
    return Rotation.from_euler("xyz", angles).as_quat(scalar_first=True)


def geom(name: str, kind: mujoco.mjtGeom, size: Sequence[float], at: Sequence[float], **rest: Any) -> Geom:
    sizes = np.zeros(3)
    sizes[: len(size)] = size
    shape = Shape(kind, sizes, np.array(at, dtype=float), rest.pop("turn", LEVEL))
    return Geom(name, shape, 0.7, 1, 1, **{"of_body": "shank", **rest})


def foot_of(*geoms: Geom, joints: int = 3) -> tuple[list[Geom], list[Geom]]:
    """Contact geoms of a link's foot, and its other geoms."""
    link = Link("shank", 1, np.zeros(3), LEVEL, 1.0, np.zeros(3), np.eye(3), (), geoms)
    limb = Limb(tuple(f"j{k}" for k in range(joints)), (4,), frozenset())
    made, leg = stand_on(link, 2, limb, limb.joints[1:], "FL", UP)
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


def test_a_rod_is_shortened_by_the_sphere_at_its_end() -> None:
    """A rod of radius 0.03 m extends from 0.03 m above the joint to 0.23 m below, in either direction."""
    for way in (0.0, np.pi):
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
        assert (len(feet), others) == (1, [])


def test_a_mesh_becomes_a_sole_where_an_ankle_can_hold_it_level() -> None:
    points = np.array([[x, y, z] for x in (-0.05, 0.15) for y in (-0.04, 0.04) for z in (-0.1, 0.0)])
    shoe = replace(geom("shoe", Kind.mjGEOM_ELLIPSOID, [0.1, 0.04, 0.05], [0.05, 0, -0.05]), points=points)
    for joints, corners in ((4, 1), (5, 4)):
        feet, _ = foot_of(shoe, joints=joints)
        lowest = [g.shape.position[2] - support(g.shape, UP) for g in feet]
        assert lowest == pytest.approx([-0.1] * corners)
