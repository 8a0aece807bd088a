"""Replaces the floor of a plant's MJCF by a ground."""

from collections.abc import Callable
from functools import partial

import mujoco
import numpy as np

from footfall.robots.spec_edits import ALL_CONTACTS, FLOOR, FLOOR_FRICTION
from footfall.terrain.boxes import boxes
from footfall.terrain.ground import Ground

SURROUNDINGS_M = 100.0  # extent of the flat ground beyond the rim
DEPTH_M = 2.0  # thickness of the ground below its lowest point


def replaced_by(ground: Ground | None) -> Callable[[mujoco.MjSpec], None] | None:
    """Function that replaces an MJCF's ground, see `replace_ground`; None if `ground` is None."""
    return None if ground is None else partial(replace_ground, ground=ground)


def replace_ground(spec: mujoco.MjSpec, ground: Ground) -> None:
    """Replace planes and height fields of the world by a ground of one piece.

    A stepped ground becomes boxes, any other a height field.
    """
    for geom in list(spec.worldbody.geoms):
        if geom.type in (mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD):
            spec.delete(geom)
    heights = np.asarray(ground.heights[0], dtype=float)
    bottom_m = float(heights.min()) - DEPTH_M
    if ground.stepped[0]:
        for rectangle in boxes(ground).tolist():
            _add_box(spec, rectangle, bottom_m)
    else:
        _add_height_field(spec, heights, ground.half_m)
    for rectangle in _surroundings(ground.half_m, float(heights[0, 0])):
        _add_box(spec, rectangle, bottom_m)


def _add_box(spec: mujoco.MjSpec, rectangle: list[float], bottom_m: float) -> None:
    """Add a box below a rectangle (lower x, upper x, lower y, upper y, height)."""
    x_low, x_high, y_low, y_high, top = rectangle
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX,
        pos=[0.5 * (x_low + x_high), 0.5 * (y_low + y_high), 0.5 * (top + bottom_m)],
        size=[0.5 * (x_high - x_low), 0.5 * (y_high - y_low), 0.5 * (top - bottom_m)],
        contype=ALL_CONTACTS,
        conaffinity=ALL_CONTACTS,
        friction=FLOOR_FRICTION,
    )


def _add_height_field(spec: mujoco.MjSpec, heights: np.ndarray, half_m: float) -> None:
    lowest, rise = float(heights.min()), max(float(np.ptp(heights)), 1e-3)
    spec.add_hfield(
        name=FLOOR,
        nrow=heights.shape[1],
        ncol=heights.shape[0],
        size=[half_m, half_m, rise, DEPTH_M],
        userdata=((heights - lowest) / rise).T.ravel(),  # its rows run along y
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname=FLOOR,
        pos=[0.0, 0.0, lowest],
        contype=ALL_CONTACTS,
        conaffinity=ALL_CONTACTS,
        friction=FLOOR_FRICTION,
    )


def _surroundings(half_m: float, height_m: float) -> list[list[float]]:
    """Rectangles around the ground, at the height of its rim."""
    far = half_m + SURROUNDINGS_M
    return [
        [-far, -half_m, -far, far, height_m],
        [half_m, far, -far, far, height_m],
        [-half_m, half_m, -far, -half_m, height_m],
        [-half_m, half_m, half_m, far, height_m],
    ]
