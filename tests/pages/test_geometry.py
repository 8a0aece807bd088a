"""Shapes of a model, as the 3-D view draws them."""

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from footfall.pages.geometry import COLLISION_GROUP, visible_shapes
from footfall.robots.description import Robot
from footfall.robots.model import plant_model


class TestGeometry:
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
