"""Shapes of ground around a level start: functions of position, with typed parameters.

A shape returns heights for the positions of its cells or grid points, from a random generator. The start is
level at height 0. The rim has one height all around, at which the ground beyond it continues.
"""

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np

from footfall.common.terms import Between

RIM_M = 0.5  # width of the level rim

Height = Annotated[float, Between(-1.0, 1.0)]  # m
Length = Annotated[float, Between(0.05, 10.0)]  # m
Start = Annotated[float, Between(0.1, 10.0)]  # m, half the width of the level start
Angle = Annotated[float, Between(-60.0, 60.0)]


class Positions(NamedTuple):
    """Positions at which a shape computes heights."""

    x: np.ndarray  # (n, n) m
    y: np.ndarray  # (n, n) m
    half_m: float  # from the middle to the rim

    @property
    def ring(self) -> np.ndarray:
        """Distance from the middle in the maximum norm, m, (n, n): equal on squares around the start."""
        return np.maximum(np.abs(self.x), np.abs(self.y))

    def room_m(self, start_m: float) -> float:
        """Distance between the start and the rim, m."""
        return max(0.0, self.half_m - RIM_M - start_m)

    def between(self, start_m: float) -> np.ndarray:
        """Whether each position is outside both the start and the rim, (n, n) bool."""
        return (self.ring > start_m) & (self.ring < self.half_m - RIM_M)


def level(positions: Positions, rng: np.random.Generator) -> np.ndarray:
    """Level ground."""
    return np.zeros_like(positions.x)


def slope(
    positions: Positions, rng: np.random.Generator, *, angle_deg: Angle, start_m: Start = 1.0
) -> np.ndarray:
    """A slope on all sides of the start, upwards; downwards for a negative angle."""
    along = np.clip(positions.ring - start_m, 0.0, positions.room_m(start_m))
    return math.tan(math.radians(angle_deg)) * along


def stairs(
    positions: Positions,
    rng: np.random.Generator,
    *,
    step_m: Height,
    tread_m: Length = 0.3,
    start_m: Start = 1.0,
) -> np.ndarray:
    """Stairs on all sides of the start, upwards; downwards for steps of negative height."""
    steps = math.floor(positions.room_m(start_m) / tread_m)
    return step_m * np.clip(np.ceil((positions.ring - start_m) / tread_m - 1e-9), 0, steps)


def rough(
    positions: Positions,
    rng: np.random.Generator,
    *,
    roughness_m: Height,
    spacing_m: Length = 0.1,
    start_m: Start = 1.0,
) -> np.ndarray:
    """Random heights up to `roughness_m` above and below 0, `spacing_m` apart, interpolated linearly."""
    points = math.ceil(2.0 * positions.half_m / spacing_m) + 2
    drawn_m = roughness_m * rng.uniform(-1.0, 1.0, (points, points))
    row, column = ((axis + positions.half_m) / spacing_m for axis in (positions.x, positions.y))
    first_row, first_column = row.astype(int), column.astype(int)
    u, v = row - first_row, column - first_column
    near = drawn_m[first_row, first_column] * (1 - v) + drawn_m[first_row, first_column + 1] * v
    far = drawn_m[first_row + 1, first_column] * (1 - v) + drawn_m[first_row + 1, first_column + 1] * v
    return np.where(positions.between(start_m), near * (1 - u) + far * u, 0.0)


def blocks(
    positions: Positions,
    rng: np.random.Generator,
    *,
    block_m: Height,
    side_m: Length = 0.45,
    start_m: Start = 1.0,
) -> np.ndarray:
    """Square blocks of random heights between 0 and `block_m`."""
    count = math.ceil(2.0 * positions.half_m / side_m) + 1
    drawn_m = block_m * rng.random((count, count))
    row, column = (
        ((axis + positions.half_m) / side_m + 1e-9).astype(int) for axis in (positions.x, positions.y)
    )
    return np.where(positions.between(start_m), drawn_m[row, column], 0.0)


def waves(
    positions: Positions,
    rng: np.random.Generator,
    *,
    wave_m: Height,
    wavelength_m: Length = 1.0,
    start_m: Start = 1.0,
) -> np.ndarray:
    """Waves along both axes, from trough to crest at most `wave_m` high."""
    wave_number = 2.0 * math.pi / wavelength_m
    heights = 0.25 * wave_m * (np.sin(wave_number * positions.x) + np.sin(wave_number * positions.y))
    return np.where(positions.between(start_m), heights, 0.0)


def gaps(
    positions: Positions,
    rng: np.random.Generator,
    *,
    gap_m: Annotated[float, Between(0.0, 1.0)],
    depth_m: Length = 0.5,
    apart_m: Length = 1.0,
    start_m: Start = 1.0,
) -> np.ndarray:
    """Trenches around the start, `gap_m` wide, with `apart_m` of level ground between them."""
    phase = (positions.ring - start_m) % (gap_m + apart_m)
    return np.where(positions.between(start_m) & (phase < gap_m - 1e-9), -depth_m, 0.0)


class Shape(NamedTuple):
    """A shape, and whether its ground is stepped."""

    heights: Callable[..., np.ndarray]
    stepped: bool


SHAPES = {
    "level": Shape(level, stepped=True),
    "slope": Shape(slope, stepped=False),
    "stairs": Shape(stairs, stepped=True),
    "rough": Shape(rough, stepped=False),
    "blocks": Shape(blocks, stepped=True),
    "waves": Shape(waves, stepped=False),
    "gaps": Shape(gaps, stepped=True),
}
