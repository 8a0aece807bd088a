"""Reads a URDF, including elements that MuJoCo ignores."""

import math
import os
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.importer.meshes import read_points
from footfall.robots.importer.shapes import hull_points, rotation_of
from footfall.robots.importer.source import (
    Source,
    compiled,
    free_the_base,
    limit_hinges,
    name_everything,
    one_line,
)

# MuJoCo would merge links that are fixed to each other and drop their names.
COMPILER = {"fusestatic": "false", "discardvisual": "true", "balanceinertia": "true", "strippath": "false"}
PACKAGE = "package://"
SMALLEST_INERTIA = 1e-9  # kg m^2
SMALLEST_RADIUS_M = 1e-3  # smallest radius of gyration
NO_SIZE = 1e-3  # m, size of the geom that replaces a mesh
NO_MASS = 1e-9  # kg and kg m^2, of a link without mass
MOMENTS = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}


class _Limit(NamedTuple):
    """Limits of a joint's motor in a URDF; None if the file has none."""

    effort_nm: float | None
    speed_rad_s: float | None


def read_urdf(path: Path, root: ET.Element, packages: tuple[Path, ...]) -> Source:
    """Read a URDF from its parsed XML; modifies `root`. See `read_source`."""
    if any("xacro" in element.tag for element in root.iter()):
        raise UserError(f"{path} is a xacro: expand it first, with 'xacro {path.name} > model.urdf'")
    if not root.findall("link"):
        raise UserError(f"{path} has no links")
    _refuse_repeated_names(root, path)
    guesses = [*_visuals_for_collisions(root, path)]
    if corrected := list(_repair_inertias(root, path)):
        guesses.append(f"physically impossible inertias were corrected: {', '.join(corrected)}")
    coupled = frozenset(j.get("name", "") for j in root.findall("joint") if j.find("mimic") is not None)
    limits = {j.get("name", ""): _limit(j, path) for j in root.findall("joint")}
    meshes = list(_take_meshes(root, path, packages))
    _remove_unused(root)
    try:
        spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    except (ValueError, mujoco.FatalError) as error:
        raise UserError(f"{path}: {one_line(error)}") from None
    placeholders = [spec.body(link).add_geom(size=[NO_SIZE, 0.0, 0.0]) for link, _ in meshes]
    name_everything(spec)
    free_the_base(spec, path)
    model = compiled(spec, path)
    guesses += limit_hinges(model)
    return Source(
        path=path,
        model=model,
        self_collisions=False,
        meshes={geom.name: points for geom, (_, points) in zip(placeholders, meshes, strict=True)},
        peak_torque_nm={n: limit.effort_nm for n, limit in limits.items() if limit.effort_nm},
        speed_rad_s={n: limit.speed_rad_s for n, limit in limits.items() if limit.speed_rad_s},
        coupled=coupled,
        guesses=tuple(guesses),
    )


def _refuse_repeated_names(root: ET.Element, path: Path) -> None:
    for kind in ("link", "joint"):
        names = Counter(element.get("name") for element in root.findall(kind))
        for name, count in names.items():
            if count > 1:
                raise UserError(f"{path}: {count} {kind}s have the name '{name}'")


def _visuals_for_collisions(root: ET.Element, path: Path) -> Iterator[str]:
    """Use visual geometry for collisions if no link has collision geometry."""
    if root.find("link/collision") is not None:
        return
    visuals = root.findall("link/visual")
    if not visuals:
        raise UserError(
            f"{path}: no link has a collision or visual geometry, so nothing can touch the ground"
        )
    for visual in visuals:
        visual.tag = "collision"
    yield "no link has a collision geometry: visual geometry was taken"


def _repair_inertias(root: ET.Element, path: Path) -> Iterator[str]:
    """Repair missing and impossible inertias, which MuJoCo refuses; yields links with impossible ones.

    A link without mass gets a negligible one: bodies fixed to it may have enough (see `build_links`).
    """
    for link in root.findall("link"):
        inertial = link.find("inertial")
        mass = inertial.find("mass") if inertial is not None else None
        entry = inertial.find("inertia") if inertial is not None else None
        mass_kg = _vector(f"{mass.get('value', 0)} 0 0", path)[0] if mass is not None else 0.0
        if inertial is None or mass is None or entry is None or not mass_kg > 0.0:
            if inertial is not None:
                link.remove(inertial)
            link.append(_negligible_inertial())
            continue
        xx, yy, zz = _vector(" ".join(entry.get(name, "0") for name in ("ixx", "iyy", "izz")), path)
        xy, xz, yz = _vector(" ".join(entry.get(name, "0") for name in ("ixy", "ixz", "iyz")), path)
        moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        min_moment = mass_kg * SMALLEST_RADIUS_M**2
        if moments[0] < min_moment:
            repaired = axes @ np.diag(np.maximum(moments, min_moment)) @ axes.T
            for name, (row, column) in MOMENTS.items():
                entry.set(name, repr(float(repaired[row, column])))
        if moments[0] < min_moment or moments[2] > moments[0] + moments[1] + SMALLEST_INERTIA:
            yield link.get("name", "")


def _negligible_inertial() -> ET.Element:
    inertial = ET.Element("inertial")
    ET.SubElement(inertial, "mass", value=str(NO_MASS))
    ET.SubElement(inertial, "inertia", {name: str(NO_MASS * (r == c)) for name, (r, c) in MOMENTS.items()})
    return inertial


def _limit(joint: ET.Element, path: Path) -> _Limit:
    limit = joint.find("limit")
    if limit is None:
        return _Limit(None, None)
    try:
        values = [float(limit.get(name, 0)) for name in ("effort", "velocity")]
    except ValueError as error:
        raise UserError(f"{path}: limit of joint {joint.get('name')}: {error}") from None
    return _Limit(*(value if math.isfinite(value) and value > 0 else None for value in values))


def _take_meshes(
    root: ET.Element, path: Path, packages: tuple[Path, ...]
) -> Iterator[tuple[str, np.ndarray]]:
    """Remove mesh collisions; returns the link's name and the hull in its frame, (k, 3) m, of each."""
    known: dict[tuple[Path, str], np.ndarray] = {}
    for link in root.findall("link"):
        for collision in link.findall("collision"):
            mesh = collision.find("geometry/mesh")
            if mesh is None:
                continue
            file, scale = _find(mesh.get("filename", ""), path, packages), mesh.get("scale", "1 1 1")
            if (file, scale) not in known:
                known[file, scale] = hull_points(read_points(file, _vector(scale, path)))
            link.remove(collision)
            yield link.get("name", ""), _placed(known[file, scale], collision.find("origin"), path)


def _placed(points: np.ndarray, origin: ET.Element | None, path: Path) -> np.ndarray:
    """Points (k, 3) transformed by a URDF's origin; its angles are about the fixed axes x, y, z, in order."""
    if origin is None:
        return points
    quaternion = np.empty(4)
    mujoco.mju_euler2Quat(quaternion, _vector(origin.get("rpy", "0 0 0"), path), "XYZ")
    return points @ rotation_of(quaternion).T + _vector(origin.get("xyz", "0 0 0"), path)


def _vector(text: str, path: Path) -> np.ndarray:
    try:
        vector = np.array(text.split(), dtype=float)
    except ValueError:
        vector = np.zeros(0)
    if vector.shape != (3,):
        raise UserError(f"{path}: expected three numbers, found '{text}'")
    return vector


def _find(name: str, urdf: Path, packages: tuple[Path, ...]) -> Path:
    """The file of a mesh; raises UserError if there is none."""
    candidates = list(_candidates(name, urdf.resolve(), packages))
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    hint = " (--packages names the folder that holds the packages)" if name.startswith(PACKAGE) else ""
    raise UserError(f"{urdf}: no mesh file for '{name}'{hint}")


def _candidates(name: str, urdf: Path, packages: tuple[Path, ...]) -> Iterator[Path]:
    if not name.startswith(PACKAGE):
        yield urdf.parent / name.removeprefix("file://")
        return
    package, _, rest = name.removeprefix(PACKAGE).lstrip("/").partition("/")
    ros_paths = filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(":"))
    for folder in (*packages, *urdf.parents, *map(Path, ros_paths)):
        yield folder / package / rest
        yield folder / rest


def _remove_unused(root: ET.Element) -> None:
    """Remove elements that MuJoCo refuses or does not need."""
    for tag in ("transmission", "gazebo", "mujoco"):
        for element in root.findall(tag):
            root.remove(element)
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
    for joint in root.findall("joint"):
        for element in joint.findall("mimic"):
            joint.remove(element)
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", COMPILER)
