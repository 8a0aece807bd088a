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

NO_ROW = -1  # the contact has no row among the constraints


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
        """Correct the contacts between spheres and the height field; returns whether there were any."""
        contacts, corrected = self._data.contact, set()
        for index, (first, second) in enumerate(self.touching()):
            if first != self._field or second not in self._radius:  # MuJoCo orders geoms by their types
                continue
            contact = contacts[index]
            if second in corrected:
                contact.exclude, contact.efc_address = 1, NO_ROW
                continue
            corrected.add(second)
            radius = self._radius[second]
            x, y, z = self._data.geom_xpos[second].tolist()
            a, b, c, gap = self._surface.nearest(x, y, z)
            half_way = 0.5 * (gap + radius)  # between the lowest point of the sphere and the surface
            contact.dist = gap - radius
            contact.pos[:] = x - a * half_way, y - b * half_way, z - c * half_way
            norm_xz = math.sqrt(a * a + c * c)  # above 0, because the normal points upwards
            tangent_1, tangent_2 = (
                (-a * b / norm_xz, norm_xz, -b * c / norm_xz),
                (-c / norm_xz, 0.0, a / norm_xz),
            )
            contact.frame[:] = (a, b, c, *tangent_1, *tangent_2)
            contact.exclude = int(contact.dist >= contact.includemargin)
            contact.efc_address = NO_ROW
        return bool(corrected)


class Surface:
    """A bilinear ground in plain numbers: for single points a tenth of the time of `tangent_at`."""

    def __init__(self, ground: Ground) -> None:
        self._heights = np.asarray(ground.heights[0], dtype=float).tolist()
        self._cell_m, self._half_m = ground.cell_m, ground.half_m
        self._last = len(self._heights) - 1

    def nearest(self, x: float, y: float, z: float) -> tuple[float, float, float, float]:
        """The surface's unit normal at the point nearest to a point, m, and the distance along it, m.

        The point is taken on the tangent below, which on curved ground is close to the true nearest point.
        Beyond the grid the ground is level.
        """
        a, b, _, gap = self._plane(x, y, x, y, z)
        return self._plane(x - a * gap, y - b * gap, x, y, z)

    def _plane(
        self, at_x: float, at_y: float, x: float, y: float, z: float
    ) -> tuple[float, float, float, float]:
        """Unit normal of the tangent at a position, and the distance of a point from the tangent."""
        height, slope_x, slope_y = self._tangent(at_x, at_y)
        c = 1.0 / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        a, b = -slope_x * c, -slope_y * c
        return a, b, c, a * (x - at_x) + b * (y - at_y) + c * (z - height)

    def _tangent(self, x: float, y: float) -> tuple[float, float, float]:
        """Height, m, and its change along x and y, as by `tangent_at`."""
        row, u, within_x = self._cell(x)
        column, v, within_y = self._cell(y)
        (low, high), (low_next, high_next) = (
            self._heights[each][column : column + 2] for each in (row, row + 1)
        )
        at_row, at_next_row = low + v * (high - low), low_next + v * (high_next - low_next)
        slope_x = (at_next_row - at_row) / self._cell_m if within_x else 0.0
        slope_y = ((1.0 - u) * (high - low) + u * (high_next - low_next)) / self._cell_m if within_y else 0.0
        return at_row + u * (at_next_row - at_row), slope_x, slope_y

    def _cell(self, position: float) -> tuple[int, float, bool]:
        """Cell along an axis, position within it, 0 to 1, and whether it is on the grid."""
        cells = (position + self._half_m) / self._cell_m
        inside = min(max(cells, 0.0), float(self._last))
        cell = min(int(inside), self._last - 1)
        return cell, inside - cell, cells == inside
