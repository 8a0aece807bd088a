"""The height scan: heights of the ground around the robot, as an observation term with its geometry."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from footfall.common.config import require_between, require_ordered
from footfall.common.errors import UserError
from footfall.common.terms import bind
from footfall.policies.contract import Contract
from footfall.robots.kinds import Kind
from footfall.robots.symmetry import Mirror

Array = Any  # a NumPy or a JAX array
HEIGHT_SCAN = "height_scan"  # name of the observation term
MAX_POINTS = 2000
Range = tuple[float, float]


@dataclass(frozen=True)
class HeightScan:
    """Heights of the ground at a grid of points, m above the base's origin, then a flag: 1 for a valid scan.
    Without a scan, all values are 0.

    The grid is in the heading frame at the time of the scan: origin at that of the base, x along the base's
    heading, y to the left, z up. Points are in rows from back to front, each row from right to left. A point
    of unknown height (NaN) gets the mean of the known ones.

    Raises:
        ValueError: a setting is out of range.
    """

    forward_m: Range = (-0.4, 0.7)  # x of the first and last row
    leftward_m: float = 0.3  # distance of the outermost points from the median plane
    spacing_m: float = 0.1  # between neighbouring points
    rate_hz: float = 25.0  # scans per second
    max_age_s: float = 0.3  # an older scan counts as missing
    clip_m: Range = (-1.0, 0.5)  # minimum and maximum of the values

    def __post_init__(self) -> None:
        require_between(self, 0.01, 1.0, "spacing_m")
        require_between(self, 0.0, 5.0, "leftward_m")
        require_between(self, -5.0, 5.0, "forward_m", "clip_m")
        require_ordered(self, "forward_m", "clip_m")
        require_between(self, 1.0, 1000.0, "rate_hz")
        require_between(self, 1.0 / self.rate_hz, 60.0, "max_age_s")
        if self.size > MAX_POINTS:
            raise ValueError(f"spacing_m: the grid has {self.size} points, more than {MAX_POINTS}")

    @property
    def _columns(self) -> int:
        return 2 * round(self.leftward_m / self.spacing_m) + 1

    @property
    def _rows(self) -> int:
        return round((self.forward_m[1] - self.forward_m[0]) / self.spacing_m) + 1

    @property
    def size(self) -> int:
        """Number of points."""
        return self._rows * self._columns

    @cached_property
    def points(self) -> np.ndarray:
        """Positions of the points in the heading frame, m, (points, 2)."""
        forward = self.forward_m[0] + self.spacing_m * np.arange(self._rows)
        leftward = self.spacing_m * (np.arange(self._columns) - self._columns // 2)
        return np.stack(np.meshgrid(forward, leftward, indexing="ij"), axis=-1).reshape(-1, 2)

    @property
    def kind(self) -> Kind:
        """Heights, then a flag for a valid scan; the mirror image exchanges left and right in each row."""
        order = np.arange(self.size).reshape(self._rows, self._columns)[:, ::-1].ravel()
        mirror = Mirror(np.append(order, self.size), np.ones(self.size + 1))
        return Kind(lambda _: (self.size + 1,), lambda _: mirror)

    def positions(
        self, position: Array, yaw: Array, shift: Array | tuple[float, float] = (0.0, 0.0)
    ) -> Array:
        """Positions of the points in the world, m, (points, 2).

        Args:
            position: position of the base, m, world, (3,).
            yaw: yaw of the base, rad.
            shift: shift of all points, forward and leftward, m, (2,).
        """
        xp = position.__array_namespace__()
        points = xp.asarray(self.points, dtype=position.dtype)
        cosine, sine = xp.cos(yaw), xp.sin(yaw)
        x = position[0] + (cosine * shift[0] - sine * shift[1])
        y = position[1] + (sine * shift[0] + cosine * shift[1])
        x = x + cosine * points[:, 0] - sine * points[:, 1]
        y = y + sine * points[:, 0] + cosine * points[:, 1]
        return xp.stack([x, y], axis=-1)

    def __call__(self, inputs: Any, contract: Contract) -> Array:
        """Values of the term, (..., points + 1), from `Inputs.height_scan`."""
        xp = inputs.command.__array_namespace__()
        heights = inputs.height_scan
        if heights is None:
            return xp.zeros((*inputs.command.shape[:-1], self.size + 1), dtype=inputs.command.dtype)
        known = xp.isfinite(heights)
        count = xp.sum(xp.astype(known, heights.dtype), axis=-1, keepdims=True)
        valid = xp.astype(count > 0.0, heights.dtype)
        low, high = self.clip_m
        clipped = xp.clip(xp.where(known, heights, 0.0), low, high)
        mean = xp.sum(xp.where(known, clipped, 0.0), axis=-1, keepdims=True) / xp.maximum(count, 1.0)
        return xp.concat([xp.where(known, clipped, mean), valid], axis=-1)


def height_scan_of(contract: Contract | None) -> HeightScan | None:
    """Height scan in a policy's observation; None if the policy uses none.

    Raises:
        UserError: its settings are out of range.
    """
    terms = [] if contract is None else [term for term in contract.observation if term.name == HEIGHT_SCAN]
    if not terms:
        return None
    scan: HeightScan = bind(HeightScan, terms[0].settings, f"contract.observation: {HEIGHT_SCAN}")
    return scan


def common_height_scan(contracts: list[Contract | None]) -> HeightScan | None:
    """Height scan of all policies in a run; None if no policy uses one.

    Raises:
        UserError: two policies use different scans.
    """
    found = {scan for contract in contracts if (scan := height_scan_of(contract)) is not None}
    if len(found) > 1:
        raise UserError("policies of one run must use the same height scan, but two of them differ")
    return found.pop() if found else None
