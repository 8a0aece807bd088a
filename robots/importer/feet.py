"""Chooses the contact geoms of each foot: the lowest ones of a limb's last link."""

from dataclasses import replace

import numpy as np

from footfall.common.errors import UserError
from footfall.robots.importer.limbs import Limb
from footfall.robots.importer.machine import Geom, Kind, Leg, Link
from footfall.robots.importer.shapes import Shape, fit_sole, lowest_point, rotation_of, support

LEVEL_M = 0.01  # geoms whose lowest points differ by less in height touch the ground together
ROUND = (Kind.mjGEOM_SPHERE, Kind.mjGEOM_ELLIPSOID)
LONG = (Kind.mjGEOM_CAPSULE, Kind.mjGEOM_CYLINDER)
WITH_ANKLE = 5  # number of joints of a leg that can keep a sole level
CORNER_M = 0.005  # radius of the spheres at the corners of a sole
LEVEL_SLOPE = 0.25  # sine of the largest angle to the ground of a capsule that lies on it
LARGEST_TIP_M = 0.04  # radius of a sphere added at the end of a limb


def leg_names(ends: list[str]) -> list[str]:
    """Names of legs: the distinct parts of their last links' names, as FL and FR of FL_calf and FR_calf."""
    tokens = [end.split("_") for end in ends]
    while all(len(words) > 1 for words in tokens) and len({words[-1] for words in tokens}) == 1:
        tokens = [words[:-1] for words in tokens]
    while all(len(words) > 1 for words in tokens) and len({words[0] for words in tokens}) == 1:
        tokens = [words[1:] for words in tokens]
    return ["_".join(words) for words in tokens]


def stand_on(
    link: Link, index: int, limb: Limb, joints: tuple[str, ...], name: str, up: np.ndarray
) -> tuple[Link, Leg]:
    """The link with its foot's geoms named, and the leg that ends in it.

    Spheres are kept. A level sole gets a small sphere at each corner. At the end of a leg with an ankle a
    mesh becomes a sole, and capsules that lie on the ground get a sphere at each corner of their outline.
    Any other end gets a sphere.

    Args:
        link: the limb's last link, with index `index`.
        limb: the limb.
        joints: the joints that only this leg has.
        name: name of the leg.
        up: the world's z in the link's frame with all joints at zero, (3,).

    Raises:
        UserError: the link has no collision geometry.
    """
    geoms = [g for g in link.geoms if g.of_body in limb.foot_bodies] or list(link.geoms)
    if not geoms:
        raise UserError(f"link {link.name} carries a foot, but no collision geometry")
    lows = np.array([g.shape.position @ up - support(g.shape, up) for g in geoms])
    lowest = geoms[int(lows.argmin())]
    near = [g for g, low in zip(geoms, lows, strict=True) if low < lows.min() + LEVEL_M]
    has_ankle = len(limb.joints) >= WITH_ANKLE
    standing = [g for g in near if _can_stand(g.shape, up)] if _can_stand(lowest.shape, up) else [lowest]
    lying = [g for g in near if has_ankle and g.points is None and _lies(g.shape, up)]
    if lowest in lying:
        standing = lying
    replaced = {g.name for g in standing}
    others = [g for g in link.geoms if g.name not in replaced]
    if lowest in lying:
        others += [replace(g, shape=_thinner(g.shape)) for g in lying]
        standing = _outline([sphere for g in lying for sphere in _ends(g)], up)
    elif has_ankle and lowest.points is not None:
        standing = [replace(lowest, shape=fit_sole(lowest.points, up))]
    elif not _can_stand(lowest.shape, up):
        standing = [replace(lowest, shape=_tip(lowest.shape, up))]
        rest = _shortened(lowest, standing[0].shape, up)
        others += [] if rest is None else [rest]
    others += [replace(g, shape=_raised(g.shape, up)) for g in standing if is_sole(g.shape, up)]
    parts = [part for g in standing for part in (_corners(g, up) if is_sole(g.shape, up) else [g])]
    feet = tuple(
        replace(g, name=f"{name}_foot{f'_{i + 1}' if len(parts) > 1 else ''}") for i, g in enumerate(parts)
    )
    leg = Leg(name, joints, index, tuple(g.name for g in feet))
    return replace(link, geoms=(*others, *feet)), leg


def _can_stand(shape: Shape, up: np.ndarray) -> bool:
    return shape.kind in ROUND or is_sole(shape, up)


def is_sole(shape: Shape, up: np.ndarray) -> bool:
    """Whether a shape is a level box, at least as long and as wide as it is high."""
    if shape.kind != Kind.mjGEOM_BOX:
        return False
    along = np.abs(rotation_of(shape.quaternion).T @ up)
    vertical = int(along.argmax())
    return along[vertical] > 0.97 and shape.size[vertical] <= np.delete(shape.size, vertical).min()


def _lies(shape: Shape, up: np.ndarray) -> bool:
    """Whether a shape is a capsule or a cylinder that lies on the ground, longer than it is wide."""
    if shape.kind not in LONG or shape.size[1] <= shape.size[0]:
        return False
    return abs(float(rotation_of(shape.quaternion)[:, 2] @ up)) < LEVEL_SLOPE


def _thinner(shape: Shape) -> Shape:
    """A capsule or a cylinder with half the radius, so that only the spheres at its ends touch the ground."""
    return shape._replace(size=shape.size * [0.5, 1.0, 1.0])


def _ends(geom: Geom) -> list[Geom]:
    """Spheres at both ends of a capsule or a cylinder."""
    shape = geom.shape
    half_axis = rotation_of(shape.quaternion)[:, 2] * shape.size[1]
    size = np.array([shape.size[0], 0.0, 0.0])
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    return [
        replace(geom, shape=Shape(Kind.mjGEOM_SPHERE, size, shape.position + side * half_axis, upright))
        for side in (1.0, -1.0)
    ]


def _outline(spheres: list[Geom], up: np.ndarray) -> list[Geom]:
    """The spheres, four at most, that are farthest towards the corners of the area that all spheres cover."""
    positions = np.array([sphere.shape.position for sphere in spheres])
    level = positions - np.outer(positions @ up, up)
    level -= (level.max(axis=0) + level.min(axis=0)) / 2
    _, sizes, axes = np.linalg.svd(level, full_matrices=False)
    along = level @ axes[:2].T / np.maximum(sizes[:2], 1e-9)
    corners = ((1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0))
    chosen = dict.fromkeys(int((along @ np.array(corner)).argmax()) for corner in corners)
    return [spheres[index] for index in chosen]


def _corners(sole: Geom, up: np.ndarray) -> list[Geom]:
    """Spheres that touch the ground at the corners of a level box, within its outline."""
    shape, radius = sole.shape, _corner_radius(sole.shape, up)
    axes = rotation_of(shape.quaternion)
    along = axes.T @ up
    vertical = int(np.abs(along).argmax())
    length_axis, width_axis = (axis for axis in range(3) if axis != vertical)
    found = []
    for front in (1.0, -1.0):
        for left in (1.0, -1.0):
            corner = np.zeros(3)
            corner[vertical] = -np.sign(along[vertical]) * (shape.size[vertical] - radius)
            corner[length_axis] = front * (shape.size[length_axis] - radius)
            corner[width_axis] = left * (shape.size[width_axis] - radius)
            centre = shape.position + axes @ corner
            size = np.array([radius, 0.0, 0.0])
            sphere = Shape(Kind.mjGEOM_SPHERE, size, centre, np.array([1.0, 0.0, 0.0, 0.0]))
            found.append(replace(sole, shape=sphere))
    return found


def _raised(shape: Shape, up: np.ndarray) -> Shape:
    """A sole without the part below the middle of its corners' spheres."""
    axes = rotation_of(shape.quaternion)
    vertical = int(np.abs(axes.T @ up).argmax())
    size, radius = shape.size.copy(), _corner_radius(shape, up)
    size[vertical] -= radius / 2
    return shape._replace(size=size, position=shape.position + up * radius / 2)


def _corner_radius(shape: Shape, up: np.ndarray) -> float:
    vertical = int(np.abs(rotation_of(shape.quaternion).T @ up).argmax())
    return float(min(CORNER_M, shape.size[vertical] / 2))


def _tip(shape: Shape, up: np.ndarray) -> Shape:
    """A sphere that touches the ground at the shape's lowest point."""
    radius = float(shape.size[0] if shape.kind in LONG else shape.size.min())
    radius = min(radius, LARGEST_TIP_M)
    size = np.array([radius, 0.0, 0.0])
    return Shape(
        Kind.mjGEOM_SPHERE, size, lowest_point(shape, up) + radius * up, np.array([1.0, 0.0, 0.0, 0.0])
    )


def _shortened(geom: Geom, tip: Shape, up: np.ndarray) -> Geom | None:
    """A long shape shortened at its end by the tip's radius, so that only the tip touches.

    None if nothing is left, or if the shape lies along the ground.
    """
    shape = geom.shape
    axes = rotation_of(shape.quaternion)
    axis = 2 if shape.kind in LONG else int(shape.size.argmax())
    half = 1 if shape.kind in LONG else axis
    slope = axes[:, axis] @ up
    size = shape.size.copy()
    size[half] -= tip.size[0] / 2
    if abs(slope) < 0.3 or size[half] <= 0.0:
        return None
    shift = np.sign(slope) * axes[:, axis] * tip.size[0] / 2
    return replace(geom, shape=shape._replace(size=size, position=shape.position + shift))
