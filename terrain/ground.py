"""A piece of ground: heights on a square grid, and the height anywhere on it.

The grid's middle is the world's origin; its first axis is x, its second y. Beyond the grid the heights of its
rim go on. Written once for NumPy and JAX.
"""

from typing import Any, NamedTuple

MOST_CELLS = 2048  # along a side
Array = Any  # a NumPy or a JAX array


class Ground(NamedTuple):
    """Heights of square cells (stepped), or of the points of a grid with slopes between them (smooth)."""

    heights: Array  # (n, n) m: of cells, or of grid points
    cell_m: float  # side of a cell
    stepped: bool  # constant in each cell; otherwise bilinear between grid points

    @property
    def half_m(self) -> float:
        """Distance from the middle to the rim, m."""
        return 0.5 * self.cell_m * (len(self.heights) - (not self.stepped))


class Tangent(NamedTuple):
    """Height and slope of the ground at places."""

    height: Array  # (...) m
    slope: Array  # (..., 2) change of the height along x and y; 0 on a stepped ground


def height_at(ground: Ground, place: Array) -> Array:
    """Height of the ground at places (..., 2) or (..., 3), m, world; (...)."""
    return tangent_at(ground, place).height


def tangent_at(ground: Ground, place: Array) -> Tangent:
    """Height and slope of the ground at places (..., 2) or (..., 3), m, world."""
    xp = place.__array_namespace__()
    if ground.stepped:
        row, column = cell_of(ground, place)
        height = ground.heights[row, column]
        return Tangent(height, xp.zeros_like(place[..., :2]))
    last = len(ground.heights) - 1
    along = (place[..., :2] + ground.half_m) / ground.cell_m
    inside = xp.clip(along, 0.0, last)
    first = xp.clip(xp.floor(inside), 0, last - 1).astype(int)
    share = inside - first
    row, column = first[..., 0], first[..., 1]
    u, v = share[..., 0], share[..., 1]
    low, high = ground.heights[row, column], ground.heights[row, column + 1]
    low_next, high_next = ground.heights[row + 1, column], ground.heights[row + 1, column + 1]
    here = low + v * (high - low)
    there = low_next + v * (high_next - low_next)
    across = (1.0 - u) * (high - low) + u * (high_next - low_next)
    slope = xp.stack([there - here, across], axis=-1) / ground.cell_m
    on_grid = (along >= 0.0) & (along <= last)
    return Tangent(here + u * (there - here), xp.where(on_grid, slope, 0.0))


def cell_of(ground: Ground, place: Array) -> tuple[Array, Array]:
    """Row and column of the cells of a stepped ground at places (..., 2 or more), each (...)."""
    xp = place.__array_namespace__()
    cells = xp.floor((place[..., :2] + ground.half_m) / ground.cell_m)
    cells = xp.clip(cells, 0, len(ground.heights) - 1).astype(int)
    return cells[..., 0], cells[..., 1]
