"""Reads a URDF or an MJCF."""

import xml.etree.ElementTree as ET
from pathlib import Path

from footfall.common.errors import UserError
from footfall.robots.importer.mjcf import read_mjcf
from footfall.robots.importer.source import Source
from footfall.robots.importer.urdf import read_urdf


def read_source(path: Path, packages: tuple[Path, ...] = ()) -> Source:
    """Read a URDF or an MJCF.

    Args:
        path: the file.
        packages: folders with the packages of a URDF's meshes, in addition to the folders above the URDF and
            ROS_PACKAGE_PATH.

    Raises:
        UserError: the file is neither, or cannot be used.
    """
    if not path.is_file():
        raise UserError(f"no file at {path}: give a URDF or an MJCF")
    try:
        root = ET.parse(path).getroot()
    except (ET.ParseError, ValueError, LookupError) as error:
        raise UserError(f"{path} is neither URDF nor MJCF: {error}") from None
    match root.tag:
        case "robot":
            return read_urdf(path, root, packages)
        case "mujoco":
            return read_mjcf(path)
    raise UserError(f"{path} is neither URDF nor MJCF: its root is <{root.tag}>, not <robot> or <mujoco>")
