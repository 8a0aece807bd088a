"""Height maps in files: NumPy arrays in metres, grey pictures."""

from pathlib import Path

import numpy as np

from footfall.common.errors import UserError
from footfall.common.installation import needs_extra
from footfall.terrain.ground import MAX_CELLS, Ground

MAX_HEIGHT_M = 10.0


def read_height_map(path: Path, cell_m: float = 0.05, top_m: float = 1.0) -> Ground:
    """A smooth ground from a file; its middle is at height 0.

    Args:
        path: .npy with heights in m, first axis x, second y; or .png, a map from above with x upwards and y
            to the left; black is 0 and white is `top_m`.
        cell_m: distance between two heights.
        top_m: height of white.

    Raises:
        UserError: the file cannot be read, or holds no heights that a robot could walk on.
    """
    if not 0.01 <= cell_m <= 1.0:
        raise UserError(f"{path}: cell_m must be from 0.01 to 1, not {cell_m:g}")
    if not 0.0 < top_m <= MAX_HEIGHT_M:
        raise UserError(f"{path}: top_m must be above 0, and {MAX_HEIGHT_M:g} at most, not {top_m:g}")
    heights = _from_picture(path, top_m) if path.suffix.lower() == ".png" else _from_array(path)
    if heights.ndim != 2 or min(heights.shape) < 2 or max(heights.shape) > MAX_CELLS:
        raise UserError(f"{path}: expected 2 to {MAX_CELLS} rows and columns, not {heights.shape}")
    if not np.isfinite(heights).all() or np.ptp(heights) > MAX_HEIGHT_M:
        raise UserError(f"{path}: heights must be finite, and differ by {MAX_HEIGHT_M:g} m at most")
    square = _square(heights)
    middle = len(square) // 2
    return Ground((square - square[middle, middle])[None], np.array([False]), cell_m)


def _square(heights: np.ndarray) -> np.ndarray:
    """The same map with its rim repeated along its shorter axis."""
    missing = max(heights.shape) - np.array(heights.shape)
    return np.pad(heights, [(each // 2, each - each // 2) for each in missing], mode="edge")


def _from_array(path: Path) -> np.ndarray:
    try:
        return np.asarray(np.load(path, allow_pickle=False), dtype=float)
    except (OSError, ValueError, EOFError, TypeError) as error:
        raise UserError(f"cannot read the heights in {path}: {error}") from None


def _from_picture(path: Path, top_m: float) -> np.ndarray:
    with needs_extra("report", f"{path}: a picture needs"):
        from PIL import Image, UnidentifiedImageError
    try:
        with Image.open(path) as picture:
            grey = np.asarray(picture.convert("I"), dtype=float)
            white = 65535.0 if picture.mode.startswith("I") else 255.0
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise UserError(f"cannot read the picture {path}: {error}") from None
    return top_m * grey[::-1, ::-1] / white  # x is upwards in the picture, y to the left
