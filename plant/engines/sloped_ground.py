"""MuJoCo C on a ground that is not level: spheres touch the ground's surface, not the prisms it is made of.

MuJoCo's height field consists of prisms that collide separately. A sphere also touches the sides of the
prisms beside the one below it: on a level height field a sphere without friction that slides at 0.5 m/s
comes to rest within a few cells, and one that is pressed in by half its radius is pushed to the side. Small
spheres, as at the corners of a sole, get caught. So here each sphere has one contact, with the surface's
own normal.

Other shapes (capsules, boxes, meshes) keep MuJoCo's contacts.
"""

import math

import mujoco
import numpy as np

from footfall.plant.engines.engine import MujocoEngine
from footfall.terrain.ground import Ground

NO_ROW = -1  # of the constraints


class SlopedGroundEngine(MujocoEngine):
    """MuJoCo C with corrected contacts between spheres and a height field."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, ground: Ground) -> None:
        """`ground` is the surface of the model's only height field; it must not be stepped."""
        super().__init__(model, data)
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ISLAND)  # found before the correction
        self._surface = Surface(ground)
        kinds, radii = model.geom_type.tolist(), model.geom_size[:, 0].tolist()
        self._radius = {
            geom: radius
            for geom, (kind, radius) in enumerate(zip(kinds, radii, strict=True))
            if kind == mujoco.mjtGeom.mjGEOM_SPHERE
        }
        self._field = kinds.index(mujoco.mjtGeom.mjGEOM_HFIELD)

    def step(self) -> None:
        """See `Engine`. The same as `mj_step`, with the correction after the search for contacts."""
        model, data = self._model, self._data
        mujoco.mj_step1(model, data)
        if self._correct():
            mujoco.mj_makeConstraint(model, data)
            mujoco.mj_projectConstraint(model, data)
            mujoco.mj_fwdVelocity(model, data)
        mujoco.mj_step2(model, data)

    def _correct(self) -> bool:
        """Correct the contacts; whether there were any to correct."""
        contacts, seen = self._data.contact, set()
        for index, (one, other) in enumerate(self.touching()):
            if one != self._field or other not in self._radius:  # MuJoCo orders geoms by their types
                continue
            contact = contacts[index]
            if other in seen:
                contact.exclude, contact.efc_address = 1, NO_ROW
                continue
            seen.add(other)
            radius = self._radius[other]
            x, y, z = self._data.geom_xpos[other].tolist()
            a, b, c, gap = self._surface.nearest(x, y, z)
            middle = 0.5 * (gap + radius)  # between the lowest point of the sphere and the surface
            contact.dist = gap - radius
            contact.pos[:] = x - a * middle, y - b * middle, z - c * middle
            in_xz = math.sqrt(a * a + c * c)  # above 0, because the normal points upwards
            along, across = (-a * b / in_xz, in_xz, -b * c / in_xz), (-c / in_xz, 0.0, a / in_xz)
            contact.frame[:] = (a, b, c, *along, *across)
            contact.exclude = int(contact.dist >= contact.includemargin)
            contact.efc_address = NO_ROW
        return bool(seen)


class Surface:
    """A bilinear ground in plain numbers: for single points a tenth of the time of `tangent_at`."""

    def __init__(self, ground: Ground) -> None:
        self._heights = np.asarray(ground.heights[0], dtype=float).tolist()
        self._cell_m, self._half_m = ground.cell_m, ground.half_m
        self._last = len(self._heights) - 1

    def nearest(self, x: float, y: float, z: float) -> tuple[float, float, float, float]:
        """The surface's unit normal at the point nearest to a point, m, and the distance along it, m.

        Nearest is the point on the tangent below, which on curved ground is close to the true one. Beyond the
        grid the ground is level.
        """
        a, b, _, gap = self._plane(x, y, x, y, z)
        return self._plane(x - a * gap, y - b * gap, x, y, z)

    def _plane(
        self, at_x: float, at_y: float, x: float, y: float, z: float
    ) -> tuple[float, float, float, float]:
        """Unit normal of the tangent at a position, and the distance of a point from the tangent."""
        height, along, across = self._tangent(at_x, at_y)
        c = 1.0 / math.sqrt(1.0 + along * along + across * across)
        a, b = -along * c, -across * c
        return a, b, c, a * (x - at_x) + b * (y - at_y) + c * (z - height)

    def _tangent(self, x: float, y: float) -> tuple[float, float, float]:
        """Height, m, and its change along x and y, as by `tangent_at`."""
        row, u, within_x = self._cell(x)
        column, v, within_y = self._cell(y)
        (low, high), (low_next, high_next) = (
            self._heights[each][column : column + 2] for each in (row, row + 1)
        )
        here, there = low + v * (high - low), low_next + v * (high_next - low_next)
        along = (there - here) / self._cell_m if within_x else 0.0
        across = ((1.0 - u) * (high - low) + u * (high_next - low_next)) / self._cell_m if within_y else 0.0
        return here + u * (there - here), along, across

    def _cell(self, position: float) -> tuple[int, float, bool]:
        """Cell along an axis, position within it, 0 to 1, and whether it is on the grid."""
        at = (position + self._half_m) / self._cell_m
        inside = min(max(at, 0.0), float(self._last))
        first = min(int(inside), self._last - 1)
        return first, inside - first, at == inside
