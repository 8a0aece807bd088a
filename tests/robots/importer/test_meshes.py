"""Mesh files: lookup, formats, refusals."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from foreign_robots import make, quadruped

from footfall.common.errors import UserError
from footfall.robots.importer.meshes import read_points

OBJ = (
    "".join(f"v {x} {y} {z}\n" for x in (0.05, 0.35) for y in (-0.02, 0.06) for z in (-0.41, -0.21))
    + "f 1 2 3\nf 4 5 6\nf 6 7 8\nf 1 4 8\n"
)


def test_meshes_are_found_in_packages_and_not_needed_after_the_import(tmp_path: Path) -> None:
    (tmp_path / "elsewhere/maker/meshes").mkdir(parents=True)
    (tmp_path / "elsewhere/maker/meshes/foot.obj").write_text(OBJ)
    mesh = '<collision><geometry><mesh filename="package://maker/meshes/foot.obj" scale="0.1 0.1 1"/>'
    text = quadruped(foot=mesh + "</geometry></collision>")
    robot, _ = make(tmp_path, text, packages=(tmp_path / "elsewhere",))
    assert mujoco.MjModel.from_xml_path(str(robot.xml_path)).nmesh == 0
    assert -robot.foot_positions[0, 2] > 0.3


def test_a_collada_scene_of_nested_nodes(tmp_path: Path) -> None:
    """The scene is in centimetres.

    Points are doubled along x, moved by 1, then turned by a quarter turn about z.
    """
    (tmp_path / "a.DAE").write_text(
        """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema">
        <asset><unit meter="0.01"/></asset><library_geometries><geometry id="g"><mesh>
        <source id="normals"><float_array>9 9 9</float_array></source>
        <source id="p"><float_array>1 2 3 4 5 6</float_array></source>
        <vertices id="v"><input semantic="POSITION" source="#p"/></vertices></mesh></geometry>
        </library_geometries><library_visual_scenes><visual_scene><node><rotate>0 0 1 90</rotate>
        <node><matrix>1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1</matrix><scale>2 1 1</scale>
        <instance_geometry url="#g"/></node></node>
        <node><translate>9 0 0</translate><instance_geometry url="#g"/></node></visual_scene>
        </library_visual_scenes></COLLADA>"""
    )
    points = read_points(tmp_path / "a.DAE", np.array([1.0, 1.0, 10.0]))
    expected = [[-2, 3, 30], [-5, 9, 60], [10, 2, 30], [13, 5, 60]]
    np.testing.assert_allclose(points, 0.01 * np.array(expected), atol=1e-9)


@pytest.mark.parametrize(
    ("up", "point"), [("Z_UP", (1, 2, 3)), ("Y_UP", (1, -3, 2)), ("X_UP", (-2, 1, 3)), (None, (1, 2, 3))]
)
def test_collada_has_an_up_axis(tmp_path: Path, up: str | None, point: tuple[float, ...]) -> None:
    (tmp_path / "a.dae").write_text(
        f"""<COLLADA><asset>{f"<up_axis>{up}</up_axis>" if up else ""}</asset><library_geometries>
        <geometry id="g"><mesh><source id="p"><float_array>1 2 3 0 0 0</float_array></source>
        <vertices id="v"><input semantic="POSITION" source="#p"/></vertices></mesh></geometry>
        </library_geometries></COLLADA>"""
    )
    assert read_points(tmp_path / "a.dae", np.ones(3))[0] == pytest.approx(point)


def test_a_binary_stl_may_begin_with_solid_as_a_text_file_does(tmp_path: Path) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], dtype="<f4")
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    body = b"".join(
        np.concatenate([np.zeros(3), *corners[list(face)]]).astype("<f4").tobytes() + b"\0\0"
        for face in faces
    )
    (tmp_path / "a.stl").write_bytes(b"solid by a tool".ljust(80) + len(faces).to_bytes(4, "little") + body)
    points = read_points(tmp_path / "a.stl", np.array([1.0, 1.0, 2.0]))
    assert sorted({tuple(p) for p in points.round(5).tolist()}) == [
        (0, 0, 0),
        (0, 0, 6),
        (0, 2, 0),
        (1, 0, 0),
    ]


@pytest.mark.parametrize("vertices", ["vertex 1 2 nan\nvertex 1 2 3\n", "vertex 1 2 3\n", "vertex a b c\n"])
def test_a_mesh_without_points_is_refused(tmp_path: Path, vertices: str) -> None:
    (tmp_path / "a.stl").write_text(f"solid a\nfacet\n{vertices}")
    with pytest.raises(UserError):
        read_points(tmp_path / "a.stl", np.ones(3))
