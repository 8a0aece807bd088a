"""Contents of the 3-D view: bodies, arrows and shapes."""

import mujoco
import numpy as np
import pytest
from ports import free_port
from scipy.spatial.transform import Rotation

from footfall.pages.geometry import COLLISION_GROUP, visible_shapes
from footfall.pages.page import serving
from footfall.pages.scene import Scene
from footfall.pages.walk import standing
from footfall.robots.description import Robot
from footfall.robots.model import plant_model


def test_bodies_are_drawn_by_frames_and_arrows_are_level_above_the_robot(go1: Robot) -> None:
    model = plant_model(go1)
    data = mujoco.MjData(model)
    tilted = Rotation.from_euler("ZYX", [2.0, -0.4, 0.3])  # a heading of 2 rad, then pitch and roll
    data.qpos[:7] = [3.0, -2.0, 0.5, *tilted.as_quat()[[3, 0, 1, 2]]]
    mujoco.mj_kinematics(model, data)
    with serving("localhost", free_port(), "test") as server:
        scene = Scene(server, go1, model)
        scene.show(data, np.array([0.5, -0.25, 0.9]), np.array([-0.1, 0.3, 0.8]), follow=False)
    height = go1.description.standing_height_m
    turned = Rotation.from_euler("Z", 2.0)
    for name, vector, above in (("command", [0.5, -0.25, 0], 0.75), ("velocity", [-0.1, 0.3, 0], 0.95)):
        arrow = scene._arrows[name]
        assert arrow.visible
        np.testing.assert_allclose(arrow.points, [[np.zeros(3), 0.4 * turned.apply(vector)]], atol=1e-6)
        np.testing.assert_allclose(arrow.position, [3.0, -2.0, 0.5 + above * height], atol=1e-6)
    for body, frame in scene.bodies.items():
        np.testing.assert_allclose(frame.position, data.xpos[body], atol=1e-6)
        np.testing.assert_allclose(frame.wxyz, data.xquat[body], atol=1e-6)
    bodies = list(scene.bodies)
    assert np.abs(data.xpos[bodies] - data.xipos[bodies]).max() > 0.01  # frames are not at centres of mass


def test_without_a_policy_the_robot_stands(go1: Robot) -> None:
    """The robot is drawn in its default pose, and its lowest foot is on the ground."""
    body = standing(go1)
    model, data = body.model, body.data
    mujoco.mj_kinematics(model, data)
    feet = [model.geom(foot.geoms[0]).id for foot in go1.description.feet]
    soles = data.geom_xpos[feet, 2] - model.geom_size[feet, 0]
    assert np.abs(soles).max() < 0.01
    height = data.body(go1.description.base).xpos[2]
    assert height == pytest.approx(go1.description.standing_height_m, abs=0.02)


def test_each_mesh_has_its_own_shape() -> None:
    corners = " ".join(f"{x} {y} {z}" for x in (0, 1) for y in (0, 2) for z in (0, 3))
    vertices = {"box": corners} | {f"m{k}": f"0 0 0 {k} 0 0 0 {2 * k} 0 0 0 {3 * k}" for k in (1, 2)}
    meshes = "".join(f'<mesh name="{name}" vertex="{points}"/>' for name, points in vertices.items())
    geoms = "".join(f'<geom type="mesh" mesh="{name}"/>' for name in ("box", "m2", "m1"))
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset>{meshes}</asset><worldbody><body>{geoms}</body></worldbody></mujoco>"
    )
    edged, two, one = visible_shapes(model)
    assert len(edged.faces) == 12
    for shape, size in ((one, 1.0), (two, 2.0)):
        turned = Rotation.from_quat(shape.quaternion[[1, 2, 3, 0]]).apply(shape.vertices)
        np.testing.assert_allclose(np.ptp(turned, axis=0), [size, 2 * size, 3 * size], rtol=1e-5)
        assert shape.faces.max() == len(shape.vertices) - 1


def test_every_visible_geom_has_its_size_position_and_colour(go1: Robot) -> None:
    model = plant_model(go1)
    shapes = {shape.geom: shape for shape in visible_shapes(model)}
    planes = model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE
    seen = np.flatnonzero((model.geom_group < COLLISION_GROUP) & ~planes)
    assert sorted(shapes) == seen.tolist()
    assert len(seen) > 30
    for geom, shape in shapes.items():
        middle, half = model.geom_aabb[geom].reshape(2, 3)
        assert shape.vertices.min(axis=0) == pytest.approx(middle - half, abs=2e-4)
        assert shape.vertices.max(axis=0) == pytest.approx(middle + half, abs=2e-4)
    accent = model.mat_rgba[model.material("accent").id]
    assert any(np.array_equal(shape.rgba, accent) for shape in shapes.values())
