"""The static stability margin: distance of the centre of mass to the edge of the support polygon."""

import math
from collections.abc import Sequence

Point = tuple[float, float]


def support_margin(feet: Sequence[Point], point: Point) -> float:
    """Distance of a point to the nearest edge of the feet's convex hull, m; negative outside.

    McGhee and Frank 1968, "On the stability properties of quadruped creeping gaits". Feet that span no area
    have a margin of at most 0: minus the distance to them.

    Args:
        feet: (x, y) of each standing foot, m.
        point: (x, y) of the centre of mass above them, m.
    """
    hull = convex_hull(feet)
    if not hull:
        return -math.inf
    edges = list(zip(hull, hull[1:] + hull[:1], strict=True))
    if len(hull) > 2:
        inside = min(_left_of(a, b, point) / math.dist(a, b) for a, b in edges)
        if inside >= 0.0:
            return inside
    return -min(_distance_to_segment(a, b, point) for a, b in edges)


def convex_hull(points: Sequence[Point]) -> list[Point]:
    """Corners counter-clockwise (Andrew's monotone chain); fewer than three if they span no area."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    lower, upper = _chain(ordered), _chain(ordered[::-1])
    return lower[:-1] + upper[:-1]


def _chain(ordered: list[Point]) -> list[Point]:
    chain: list[Point] = []
    for point in ordered:
        while len(chain) > 1 and _left_of(chain[-2], chain[-1], point) <= 0.0:
            chain.pop()
        chain.append(point)
    return chain


def _left_of(a: Point, b: Point, point: Point) -> float:
    """Twice the area of a triangle: positive where the point is left of the line from a to b."""
    return (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0])


def _distance_to_segment(a: Point, b: Point, point: Point) -> float:
    along = (b[0] - a[0], b[1] - a[1])
    square = along[0] ** 2 + along[1] ** 2
    share = ((point[0] - a[0]) * along[0] + (point[1] - a[1]) * along[1]) / square if square else 0.0
    share = min(max(share, 0.0), 1.0)
    return math.dist(point, (a[0] + share * along[0], a[1] + share * along[1]))
