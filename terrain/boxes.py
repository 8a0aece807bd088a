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
    cells = []
    for row, column in np.ndindex(*heights.shape):
        if not free[row, column]:
            continue
        height = heights[row, column]
        same_height = free & (heights == height)
        columns = _run(same_height[row, column:])
        rows = _run(same_height[row:, column : column + columns].all(axis=1))
        free[row : row + rows, column : column + columns] = False
        cells.append((row, row + rows, column, column + columns, height))
    rectangles = np.array(cells, dtype=float)
    rectangles[:, :4] = rectangles[:, :4] * ground.cell_m - ground.half_m
    return rectangles


def _run(same_height: np.ndarray) -> int:
    """Number of leading True."""
    return len(same_height) if same_height.all() else int(same_height.argmin())
