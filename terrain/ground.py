"""Pieces of ground: heights on square grids; height, slope and nearest edge at any point.

The middle of each piece is the origin; its first axis is x, its second y. Beyond the grid the heights of its
rim continue. For NumPy and JAX.
"""

from typing import Any, NamedTuple

MAX_CELLS = 2048  # along a side
SAME_M = 1e-3  # cells whose heights differ by less belong to one level
UNREACHABLE_M = -1e3  # height of a level that nothing can touch
FAR_M = 1e3  # distance of an edge that was not found

Array = Any  # a NumPy or a JAX array


class Ground(NamedTuple):
    """Pieces of one size. A stepped piece is constant in each cell, others are bilinear in between."""

    heights: Array  # (pieces, n, n) m, at grid points; in a stepped piece, of the cell that begins there
    stepped: Array  # (pieces,) bool
    cell_m: float  # side of a cell

    @property
    def half_m(self) -> float:
        """Distance from the middle to the rim, m."""
        return 0.5 * self.cell_m * (self.heights.shape[-1] - 1)


class Tangent(NamedTuple):
    """Height and slope of the ground at points."""

    height: Array  # (...) m
    slope: Array  # (..., 2) change of the height along x and y; 0 on a stepped piece


class Edge(NamedTuple):
    """The edge that is nearest to a point of a stepped piece, and the levels on both sides."""

    normal: Array  # (..., 2) horizontal unit normal, from the higher level to the lower one
    offset: Array  # (...) m, of the edge from the origin along that normal
    low: Array  # (...) m, height of the lower level; without an edge, of the point's cell
    high: Array  # (...) m, height of the higher one; without an edge far below everything


def height_at(ground: Ground, position: Array, piece: Array | int = 0) -> Array:
    """Height of the ground at positions (..., 2) or (..., 3), m; (...)."""
    return tangent_at(ground, position, piece).height


def tangent_at(ground: Ground, position: Array, piece: Array | int = 0) -> Tangent:
    """Height and slope of the ground at positions (..., 2) or (..., 3), m, on a piece (one, or (...))."""
    xp = position.__array_namespace__()
    heights = ground.heights
    row, column, fraction, inside = _cell(ground, position)
    u, v = (xp.where(ground.stepped[piece], 0.0, fraction[..., axis]) for axis in (0, 1))
    h00, h01 = heights[piece, row, column], heights[piece, row, column + 1]
    h10, h11 = heights[piece, row + 1, column], heights[piece, row + 1, column + 1]
    near, far = h00 + v * (h01 - h00), h10 + v * (h11 - h10)
    rise_y = (1.0 - u) * (h01 - h00) + u * (h11 - h10)
    slope = xp.stack([far - near, rise_y], axis=-1) / ground.cell_m
    sloped = inside & ~xp.expand_dims(xp.asarray(ground.stepped[piece]), -1)
    return Tangent(near + u * (far - near), xp.where(sloped, slope, 0.0))


def edge_at(ground: Ground, position: Array, piece: Array | int = 0, reach: int = 2) -> Edge:
    """The nearest edge along x or y from positions (..., 2) or (..., 3), m; only a stepped piece has any.

    Args:
        ground: the pieces.
        position: the points.
        piece: index of the piece, one or (...).
        reach: largest distance of an edge, in cells.
    """
    xp = position.__array_namespace__()
    row, column, fraction, _ = _cell(ground, position)
    last_cell = ground.heights.shape[-1] - 2
    here = ground.heights[piece, row, column]
    nearest = xp.full_like(here, FAR_M)
    normal, other_height = xp.zeros_like(position[..., :2]), xp.full_like(here, UNREACHABLE_M)
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
        for cells in range(1, reach + 1):
            cell = [row, column]
            cell[axis] = xp.clip(cell[axis] + sign * cells, 0, last_cell)
            there = ground.heights[piece, cell[0], cell[1]]
            to_border = fraction[..., axis] if sign < 0 else 1.0 - fraction[..., axis]
            distance = (to_border + (cells - 1)) * ground.cell_m
            nearer = (xp.abs(there - here) > SAME_M) & (distance < nearest)
            sign_of_normal = xp.where(there > here, -1.0, 1.0) * sign
            direction = xp.zeros_like(normal) + xp.expand_dims(sign_of_normal, -1) * _unit(xp, axis, normal)
            nearest = xp.where(nearer, distance, nearest)
            normal = xp.where(nearer[..., None], direction, normal)
            other_height = xp.where(nearer, there, other_height)
    has_edge = (nearest < FAR_M) & ground.stepped[piece]
    along_normal = xp.where(other_height > here, -nearest, nearest)  # from the position to the edge
    offset = (normal * position[..., :2]).sum(axis=-1) + along_normal
    return Edge(
        normal=normal,
        offset=xp.where(has_edge, offset, UNREACHABLE_M),
        low=xp.where(has_edge, xp.minimum(here, other_height), here),
        high=xp.where(has_edge, xp.maximum(here, other_height), UNREACHABLE_M),
    )


def _unit(xp: Any, axis: int, like: Array) -> Array:
    return xp.asarray([1.0 - axis, float(axis)], dtype=like.dtype)


def _cell(ground: Ground, position: Array) -> tuple[Array, Array, Array, Array]:
    """Row, column and position within the cell, 0 to 1, of points; which axes lie within the grid."""
    xp = position.__array_namespace__()
    along = (position[..., :2] + ground.half_m) / ground.cell_m
    last = ground.heights.shape[-1] - 1
    clipped = xp.clip(along, 0.0, last)
    first = xp.clip(xp.floor(clipped), 0, last - 1)
    cell = first.astype(int)
    return cell[..., 0], cell[..., 1], clipped - first, (along >= 0.0) & (along <= last)
