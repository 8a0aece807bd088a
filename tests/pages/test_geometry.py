"""Shapes of a model, as the 3-D view draws them."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.pages.geometry import COLLISION_GROUP, visible_shapes
from footfall.robots.description import Robot
from footfall.robots.model import plant_model


class TestGeometry:
    @pytest.mark.parametrize(
        ("geom", "extent"),
        [
            ('type="box" size=".1 .2 .3"', (0.2, 0.4, 0.6)), ('type="sphere" size=".1"', (0.2, 0.2, 0.2)),
            ('type="ellipsoid" size=".1 .2 .3"', (0.2, 0.4, 0.6)), ('type="capsule" size=".1 .3"', (0.2,
            0.2, 0.8)),
            ('type="cylinder" size=".1 .3"', (0.2, 0.2, 0.6)),
        ],
    )  # fmt: skip
    def test_each_kind_has_its_size_about_its_middle(self, geom: str, extent: tuple[float, ...]) -> None:
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><worldbody><body><geom {geom} pos="1 2 3" euler="10 20 30" rgba=".1 .2 .3 .4"/>'
            '<geom size="1" group="3"/></body><geom type="plane" size="1 1 1"/></worldbody></mujoco>'
        )
        (shape,) = visible_shapes(model)
        np.testing.assert_allclose(np.ptp(shape.vertices, axis=0), extent, rtol=0.02)
        middle = (shape.vertices.max(axis=0) + shape.vertices.min(axis=0)) / 2
        np.testing.assert_allclose(middle, np.zeros(3), atol=1e-6)
        np.testing.assert_allclose(shape.position, [1, 2, 3])
        turned = Rotation.from_euler("XYZ", [10, 20, 30], degrees=True)
        np.testing.assert_allclose(shape.quaternion, turned.as_quat()[[3, 0, 1, 2]], atol=1e-12)
        np.testing.assert_allclose(shape.rgba, [0.1, 0.2, 0.3, 0.4], atol=1e-6)
        assert (shape.geom, shape.body) == (1, 1)  # the first is the ground

    def test_each_mesh_has_its_own_shape(self) -> None:
        corners = " ".join(f"{x} {y} {z}" for x in (0, 1) for y in (0, 2) for z in (0, 3))
        box = f'<mesh name="box" vertex="{corners}"/>'
        shapes = " ".join(
            f'<mesh name="m{k}" vertex="0 0 0 {k} 0 0 0 {2 * k} 0 0 0 {3 * k}"/>' for k in (1, 2)
        )
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><asset>{box}{shapes}</asset><worldbody><body><geom type="mesh" mesh="box"/>'
            '<geom type="mesh" mesh="m2"/>'
            '<geom type="mesh" mesh="m1"/></body></worldbody></mujoco>'
        )
        edged, two, one = visible_shapes(model)
        assert len(edged.faces) == 12
        for shape, size in ((one, 1.0), (two, 2.0)):
            turned = Rotation.from_quat(shape.quaternion[[1, 2, 3, 0]]).apply(shape.vertices)
            np.testing.assert_allclose(np.ptp(turned, axis=0), [size, 2 * size, 3 * size], rtol=1e-5)
            assert shape.faces.max() == len(shape.vertices) - 1

    @pytest.fixture(autouse=True)
    def _needs_trimesh(self) -> None:
        pytest.importorskip("trimesh")

    def test_every_visible_geom_has_its_size_position_and_colour(self, go1: Robot) -> None:
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

    def test_meshes_are_drawn_at_mujocos_positions(self) -> None:
        vertices = "0 0 0 1 0 0 0 2 0 0 0 3"
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><asset><mesh name="m" vertex="{vertices}"/></asset>'
            '<worldbody><body><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
        )
        (shape,) = visible_shapes(model)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, shape.quaternion)
        placed = shape.vertices @ rotation.reshape(3, 3).T + shape.position
        assert np.ptp(placed, axis=0) == pytest.approx([1, 2, 3], abs=1e-5)
        assert placed.min(axis=0) == pytest.approx([0, 0, 0], abs=1e-5)
