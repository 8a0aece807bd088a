"""Meshes, packages, limits and inertias read from a URDF."""

from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from foreign_robots import make, quadruped, read
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.robots.importer.meshes import read_points
from footfall.robots.importer.read import read_source

CUBE = "".join(f"v {x} {y} {z}\n" for x in (0, 0.1) for y in (0, 0.2) for z in (0, 0.3))
CUBE += "f 1 2 3\nf 4 5 6\nf 6 7 8\nf 1 4 8\n"


def points_with(tmp_path: Path, mesh: str, origin: str = "", **packages: Any) -> list[np.ndarray]:
    """Points of the meshes of a URDF with such feet, one array for each size."""
    foot = f"<collision>{origin}<geometry><mesh {mesh}/></geometry></collision>"
    (tmp_path / "robot").mkdir(exist_ok=True)
    (tmp_path / "robot/m.urdf").write_text(quadruped(foot=foot))
    return list(read_source(tmp_path / "robot/m.urdf", **packages).meshes.values())


def test_a_mesh_is_scaled_turned_about_fixed_axes_and_moved(tmp_path: Path) -> None:
    (tmp_path / "c.obj").write_text(CUBE)
    origin = '<origin rpy="0.3 -0.5 0.9" xyz="1 2 3"/>'
    found = points_with(tmp_path, f'filename="file://{tmp_path}/c.obj" scale="1 -2 0.5"', origin)[0]
    corners = np.array([[x, y, z] for x in (0, 0.1) for y in (0, -0.4) for z in (0, 0.15)])
    expected = Rotation.from_euler("xyz", [0.3, -0.5, 0.9]).apply(corners) + np.array([1, 2, 3])
    np.testing.assert_allclose(sorted(found.round(6).tolist()), sorted(expected.round(6).tolist()), atol=2e-6)


def test_one_file_in_two_sizes_gives_two_shapes(tmp_path: Path) -> None:
    (tmp_path / "c.obj").write_text(CUBE)
    mesh = '<collision><geometry><mesh filename="c.obj" scale="1 1 1"/></geometry></collision>'
    head, _, tail = quadruped(foot=mesh).rpartition('scale="1 1 1"')
    source = read(tmp_path, f'{head}scale="3 1 1"{tail}')
    sizes = [points[:, 0].max() for points in source.meshes.values()]
    assert sizes == pytest.approx([0.1, 0.1, 0.1, 0.3])


def test_packages_are_searched_for_meshes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given, ros = tmp_path / "given", tmp_path / "ros/elsewhere"
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{ros}")
    folders = (ros / "maker", tmp_path / "maker", given / "maker")
    for size, folder in enumerate(folders, start=1):
        folder.mkdir(parents=True)
        (folder / "c.obj").write_text(CUBE.replace("v 0.1", f"v {size}"))
        points = points_with(tmp_path, 'filename="package://maker/c.obj"', packages=(given,))
        assert points[0][:, 0].max() == pytest.approx(size)
    (given / "c.obj").write_text(CUBE.replace("v 0.1", "v 9"))
    points = points_with(tmp_path, 'filename="package://other/c.obj"', packages=(given,))
    assert points[0][:, 0].max() == pytest.approx(9.0)


def test_effort_and_velocity_count_where_they_are_above_zero(tmp_path: Path) -> None:
    source = read(tmp_path, quadruped(knee_limit='<limit lower="-2" upper="-1" effort="7" velocity="0"/>'))
    assert (source.peak_torque_nm["FL_knee"], source.peak_torque_nm["FL_roll"]) == (7.0, 21.0)
    assert "FL_knee" not in source.speed_rad_s
    assert source.speed_rad_s["RR_hip"] == 16.0


def test_visual_geometry_is_used_only_without_collision_geometry(tmp_path: Path) -> None:
    visual = '<visual><origin xyz="0 0 -0.2"/><geometry><sphere radius="0.03"/></geometry></visual>'
    some = read(tmp_path, quadruped(thigh=visual))
    assert 0.03 not in some.model.geom_size[:, 0]
    none = read(tmp_path, quadruped(foot=visual).replace("collision>", "visual>"))
    assert (none.model.geom_size[:, 0] == 0.03).sum() == 4
    assert none.guesses == ("no link has a collision geometry: visual geometry was taken",)
    assert some.guesses == ()
    with pytest.raises(UserError):
        read(tmp_path, '<robot name="r"><link name="a"/></robot>')


def test_an_impossible_inertia_is_raised_to_a_radius_of_a_millimetre(tmp_path: Path) -> None:
    """A mass of 0.4 kg has at least 4e-7 kg m^2 about its thinnest axis; the other inertias stay."""
    moments = 'ixx="0.0016" iyy="0.002" izz="0.0012000000000000001" ixy="0.00016" ixz="0.0" iyz="0.0"'
    text = quadruped()
    assert moments in text
    flat = 'ixx="0.002" iyy="0.001" izz="0" ixy="0" ixz="0" iyz="0"'
    source = read(tmp_path, text.replace(moments, flat))
    (guess,) = source.guesses
    assert "arm_link" in guess
    assert read(tmp_path, text).guesses == ()
    weightless = text.replace('<mass value="0.4"/>', '<mass value="0"/>')
    assert read(tmp_path, weightless).model.body("arm_link").mass[0] < 1e-6


def test_meshes_are_found_in_packages_and_not_needed_after_the_import(tmp_path: Path) -> None:
    (tmp_path / "elsewhere/maker/meshes").mkdir(parents=True)
    (tmp_path / "elsewhere/maker/meshes/foot.obj").write_text(CUBE)
    mesh = '<mesh filename="package://maker/meshes/foot.obj" scale="0.2 0.2 1"/>'
    foot = f'<collision><origin xyz="0 0 -0.4"/><geometry>{mesh}</geometry></collision>'
    robot, _ = make(tmp_path, quadruped(foot=foot), packages=(tmp_path / "elsewhere",))
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
    records = (np.concatenate([np.zeros(3), *corners[list(face)]]).astype("<f4") for face in faces)
    body = b"".join(record.tobytes() + b"\0\0" for record in records)
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
