"""A stepped ground as boxes: neighbouring cells of equal height are merged."""

import numpy as np

from footfall.terrain.ground import Ground


def boxes(ground: Ground) -> np.ndarray:
    """Rectangles that cover a ground of one stepped piece.

    Returns:
        Each rectangle's lower x, upper x, lower y, upper y and height, m, (boxes, 5).
    """
    heights = np.asarray(ground.heights)[0, :-1, :-1]
    free = np.ones(heights.shape, dtype=bool)
    found = []
    for row, column in np.ndindex(*heights.shape):
        if not free[row, column]:
            continue
        height = heights[row, column]
        alike = free & (heights == height)
        columns = _run(alike[row, column:])
        rows = _run(alike[row:, column : column + columns].all(axis=1))
        free[row : row + rows, column : column + columns] = False
        found.append((row, row + rows, column, column + columns, height))
    rectangles = np.array(found, dtype=float)
    rectangles[:, :4] = rectangles[:, :4] * ground.cell_m - ground.half_m
    return rectangles


def _run(alike: np.ndarray) -> int:
    """Number of leading True."""
    return len(alike) if alike.all() else int(alike.argmin())
