"""Vertices of mesh files: MuJoCo reads OBJ and binary STL; this module reads Collada and text STL."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.importer.shapes import rotation_of

VERTEX = re.compile(r"vertex\s+(\S+)\s+(\S+)\s+(\S+)")
# From a Collada file's axes to axes with z up; files without <up_axis> are not rotated.
TO_Z_UP = {
    "X_UP": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "Y_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
}
TRANSFORMS = ("matrix", "translate", "scale", "rotate")


def read_points(path: Path, scale: np.ndarray) -> np.ndarray:
    """Vertices of a mesh file, (k, 3) m, each axis scaled.

    Raises:
        UserError: the file is missing or is not a readable mesh.
    """
    if not path.is_file():
        raise UserError(f"no mesh file at {path}")
    if path.suffix.lower() == ".dae":
        points = _collada(path)
    else:
        points = _text_stl(path) if _is_text_stl(path) else _by_mujoco(path)
    if len(points) < 2 or not np.isfinite(points).all():
        raise UserError(f"{path} holds no points of a mesh")
    return points * scale


def _is_text_stl(path: Path) -> bool:
    """Whether a file is text STL, which MuJoCo cannot read. A binary header may also begin with "solid"."""
    if path.suffix.lower() != ".stl":
        return False
    with path.open("rb") as file:
        head = file.read(1000)
    return head.lstrip().startswith(b"solid") and b"facet" in head


def _text_stl(path: Path) -> np.ndarray:
    try:
        return np.array(VERTEX.findall(path.read_text(encoding="utf-8", errors="replace")), dtype=float)
    except ValueError as error:
        raise UserError(f"cannot read mesh {path}: {error}") from None


def _by_mujoco(path: Path) -> np.ndarray:
    spec = mujoco.MjSpec()
    mesh = spec.add_mesh(name="mesh", file=str(path.resolve()))
    mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # the mesh need not be closed
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="mesh")
    try:
        model = spec.compile()
    except ValueError as error:
        raise UserError(f"cannot read mesh {path}: {' '.join(str(error).split())}") from None
    return mesh_points(model, 0)


def mesh_points(model: mujoco.MjModel, mesh: int) -> np.ndarray:
    """Vertices of a compiled mesh as in its file, (k, 3) m: undoes MuJoCo's centring and rotation."""
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    points = model.mesh_vert[start : start + count] @ rotation_of(model.mesh_quat[mesh]).T
    return points + model.mesh_pos[mesh]


def _collada(path: Path) -> np.ndarray:
    """Positions of all geometries of a Collada file, through the transforms of its scene, m."""
    try:
        return _points_of_scene(ET.parse(path).getroot())
    except (ET.ParseError, ValueError) as error:
        raise UserError(f"cannot read mesh {path}: {error}") from None


def _points_of_scene(root: ET.Element) -> np.ndarray:
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    geometries = {f"#{g.get('id')}": _positions(g) for g in root.iter("geometry")}
    found: list[np.ndarray] = []
    for scene in root.iter("visual_scene"):
        for node in scene.findall("node"):
            _collect(node, np.eye(4), geometries, found)
    points = np.concatenate(found or [*geometries.values(), np.zeros((0, 3))])
    unit, up = root.find("asset/unit"), root.findtext("asset/up_axis", "Z_UP").strip()
    points = points * float(unit.get("meter", 1.0) if unit is not None else 1.0)
    return points @ TO_Z_UP.get(up, np.eye(3)).T


def _positions(geometry: ET.Element) -> np.ndarray:
    """The points of a geometry's <vertices>, (k, 3)."""
    for entry in geometry.iter("input"):
        if entry.get("semantic") == "POSITION":
            source = (entry.get("source") or "").lstrip("#")
            for candidate in geometry.iter("source"):
                array = candidate.find("float_array")
                if candidate.get("id") == source and array is not None:
                    return np.array((array.text or "").split(), dtype=float).reshape(-1, 3)
    return np.zeros((0, 3))


def _collect(
    node: ET.Element, parent_transform: np.ndarray, geometries: dict[str, np.ndarray], found: list[np.ndarray]
) -> None:
    transform = parent_transform
    for child in node:
        if child.tag not in TRANSFORMS:
            continue
        numbers, local = np.array((child.text or "").split(), dtype=float), np.eye(4)
        if child.tag == "matrix":
            local = numbers.reshape(4, 4)
        elif child.tag == "translate":
            local[:3, 3] = numbers
        elif child.tag == "scale":
            local[:3, :3] = np.diag(numbers)
        else:
            quaternion = np.empty(4)
            mujoco.mju_axisAngle2Quat(quaternion, numbers[:3], np.deg2rad(numbers[3]))
            local[:3, :3] = rotation_of(quaternion)
        transform = transform @ local
    for instance in node.findall("instance_geometry"):
        points = geometries.get(instance.get("url") or "", np.zeros((0, 3)))
        found.append(points @ transform[:3, :3].T + transform[:3, 3])
    for child in node.findall("node"):
        _collect(child, transform, geometries, found)
