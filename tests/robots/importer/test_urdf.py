"""Meshes, packages, limits and inertias read from a URDF."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_robots import quadruped, read
from scipy.spatial.transform import Rotation

from footfall.common.errors import UserError
from footfall.robots.importer.read import read_source
from footfall.robots.importer.source import Source

CUBE = (
    "".join(f"v {x} {y} {z}\n" for x in (0, 0.1) for y in (0, 0.2) for z in (0, 0.3)) + "f 1 2 3\nf 6 7 8\n"
)


def source_with(tmp_path: Path, mesh: str, origin: str = "", **packages: Any) -> Source:
    foot = f"<collision>{origin}<geometry><mesh {mesh}/></geometry></collision>"
    (tmp_path / "robot").mkdir(exist_ok=True)
    (tmp_path / "robot/m.urdf").write_text(quadruped(foot=foot))
    return read_source(tmp_path / "robot/m.urdf", **packages)


def test_a_mesh_is_scaled_turned_about_fixed_axes_and_moved(tmp_path: Path) -> None:
    (tmp_path / "c.obj").write_text(CUBE)
    origin = '<origin rpy="0.3 -0.5 0.9" xyz="1 2 3"/>'
    source = source_with(tmp_path, f'filename="file://{tmp_path}/c.obj" scale="1 -2 0.5"', origin)
    corners = np.array([[x, y, z] for x in (0, 0.1) for y in (0, -0.4) for z in (0, 0.15)])
    expected = Rotation.from_euler("xyz", [0.3, -0.5, 0.9]).apply(corners) + np.array([1, 2, 3])
    found = next(iter(source.meshes.values()))
    np.testing.assert_allclose(sorted(found.round(6).tolist()), sorted(expected.round(6).tolist()), atol=2e-6)


def test_one_file_in_two_sizes_gives_two_shapes(tmp_path: Path) -> None:
    (tmp_path / "c.obj").write_text(CUBE)
    text = quadruped(
        foot='<collision><geometry><mesh filename="c.obj" scale="1 1 1"/></geometry></collision>'
    )
    head, found, tail = text.rpartition('scale="1 1 1"')
    (tmp_path / "m.urdf").write_text(f'{head}scale="3 1 1"{tail}')
    assert found
    sizes = [points[:, 0].max() for points in read_source(tmp_path / "m.urdf").meshes.values()]
    assert sizes == pytest.approx([0.1, 0.1, 0.1, 0.3])


def test_packages_are_searched_for_meshes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given, ros = tmp_path / "given", tmp_path / "ros/elsewhere"
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"/nowhere:{ros}")
    folders = (ros / "maker", tmp_path / "maker", given / "maker")
    for size, folder in enumerate(folders, start=1):
        folder.mkdir(parents=True)
        (folder / "c.obj").write_text(CUBE.replace("v 0.1", f"v {size}"))
        source = source_with(tmp_path, 'filename="package://maker/c.obj"', packages=(given,))
        assert next(iter(source.meshes.values()))[:, 0].max() == pytest.approx(size)
    (given / "c.obj").write_text(CUBE.replace("v 0.1", "v 9"))
    source = source_with(tmp_path, 'filename="package://other/c.obj"', packages=(given,))
    assert next(iter(source.meshes.values()))[:, 0].max() == pytest.approx(9.0)


def test_effort_and_velocity_count_where_they_are_above_zero(tmp_path: Path) -> None:
    source = read(
        tmp_path, quadruped(knee_limit='<limit lower="-2" upper="-1" effort="7" velocity="0"/>'), "urdf"
    )
    assert (source.peak_torque_nm["FL_knee"], source.peak_torque_nm["FL_roll"]) == (7.0, 21.0)
    assert "FL_knee" not in source.speed_rad_s
    assert source.speed_rad_s["RR_hip"] == 16.0


def test_visual_geometry_is_used_only_without_collision_geometry(tmp_path: Path) -> None:
    visual = '<visual><origin xyz="0 0 -0.2"/><geometry><sphere radius="0.03"/></geometry></visual>'
    some = read(tmp_path, quadruped(thigh=visual), "urdf")
    assert 0.03 not in some.model.geom_size[:, 0]
    only = quadruped(foot=visual).replace("collision>", "visual>")
    none = read(tmp_path, only, "urdf")
    assert (none.model.geom_size[:, 0] == 0.03).sum() == 4
    assert none.guesses == ("no link has a collision geometry: visual geometry was taken",)
    assert some.guesses == ()
    with pytest.raises(UserError):
        read(tmp_path, '<robot name="r"><link name="a"/></robot>', "urdf")


def test_a_continuous_joint_turns_half_a_turn_either_way(tmp_path: Path) -> None:
    source = read(
        tmp_path, quadruped(knee_kind="continuous", knee_limit='<limit effort="3" velocity="7"/>'), "urdf"
    )
    np.testing.assert_allclose(source.model.joint("RL_knee").range, [-np.pi, np.pi])


def test_an_impossible_inertia_is_raised_to_a_radius_of_a_millimetre(tmp_path: Path) -> None:
    """A mass of 0.4 kg has at least 4e-7 kg m^2 about its thinnest axis; the other inertias stay."""
    moments = 'ixx="0.0016" iyy="0.002" izz="0.0012000000000000001" ixy="0.00016" ixz="0.0" iyz="0.0"'
    text = quadruped()
    assert moments in text
    flat = 'ixx="0.002" iyy="0.001" izz="0" ixy="0" ixz="0" iyz="0"'
    source = read(tmp_path, text.replace(moments, flat), "urdf")
    (guess,) = source.guesses
    assert "arm_link" in guess
    assert read(tmp_path, text, "urdf").guesses == ()
    weightless = text.replace('<mass value="0.4"/>', '<mass value="0"/>')
    assert read(tmp_path, weightless, "urdf").model.body("arm_link").mass[0] < 1e-6
