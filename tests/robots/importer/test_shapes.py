"""Primitive shapes fitted to points."""

from collections.abc import Sequence

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.robots.importer import shapes
from footfall.robots.importer.pose import lowest_height
from footfall.robots.importer.shapes import Kind, Shape, fit_along, fit_shape, rotation_of

UP = np.array([0.0, 0.0, 1.0])
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


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        (Kind.mjGEOM_SPHERE, (0.07, 0.0, 0.0)),
        (Kind.mjGEOM_CAPSULE, (0.03, 0.1, 0.0)),
        (Kind.mjGEOM_CYLINDER, (0.05, 0.1, 0.0)),
        (Kind.mjGEOM_ELLIPSOID, (0.03, 0.06, 0.1)),
        (Kind.mjGEOM_BOX, (0.03, 0.06, 0.1)),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_shape_reaches_to_its_surface(kind: mujoco.mjtGeom, size: tuple[float, ...], sign: float) -> None:
    up = sign * np.array([0.8, 0.36, 0.48])
    shape = Shape(kind, np.array(size), PLACE, TURN.as_quat(scalar_first=True))
    points = TURN.apply(surface(kind, size)) + PLACE
    assert shapes.support(shape, up) == pytest.approx(((points - PLACE) @ up).max(), abs=2e-4)
    lowest = shapes.lowest_point(shape, up)
    assert lowest @ up == pytest.approx((points @ up).min(), abs=2e-4)
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


UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def sphere(radius: float, z: float) -> Shape:
    return Shape(Kind.mjGEOM_SPHERE, np.array([radius, 0.0, 0.0]), np.array([0.0, 0.0, z]), UPRIGHT)


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
    rod = Shape(Kind.mjGEOM_CAPSULE, np.array([0.01, 0.1, 0.0]), np.zeros(3), UPRIGHT)
    found = fit_along([rod, sphere(0.02, -0.1)], np.array([0.0, 0.0, 1.0]))
    assert found.size[0] == pytest.approx(0.015, abs=1e-3)
    assert found.size[1] == pytest.approx(0.1, abs=2e-3)
