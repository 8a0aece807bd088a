"""Markers in 3-D views: a visualization_msgs/MarkerArray of named markers."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from footfall.deploy.telemetry.messages import Template

Point = Iterable[float]  # x, y, z, m
Colour = tuple[float, float, float, float]  # red, green, blue, opacity

LIFETIME_NS = 300_000_000  # after which a marker disappears unless it is renewed
ARROW, SPHERE, CYLINDER, LINE_STRIP = 0, 2, 3, 4
WIDTH_M = 0.01  # of lines and arrows
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


class Marker(NamedTuple):
    """One marker. `points` define a line or an arrow; other markers are at `position`."""

    name: str  # namespace
    number: int
    kind: int
    size: tuple[float, float, float]
    colour: Colour
    position: Point = (0.0, 0.0, 0.0)
    points: Sequence[Point] = ()


def marker_array(time_ns: int, frame: str, markers: Sequence[Marker]) -> bytes:
    """Message with markers in a frame."""
    template = Template().count(len(markers))
    for marker in markers:
        template.stamp(frame).text(marker.name).put("i", marker.number, marker.kind, 0)
        template.put("d", *marker.position, *UPRIGHT, *marker.size).put("f", *marker.colour)
        template.put("i", 0).put("I", LIFETIME_NS).put("B", 0).count(len(marker.points))
        for point in marker.points:
            template.put("d", *point)
        template.count(0).text("")  # colours of points, texture
        template.put("i", 0).put("I", 0).text("").text("").count(0)  # the texture's image
        template.count(0).text("").text("")  # texture coordinates, text, mesh
        template.text("").count(0).put("B", 0)  # the mesh's file
    return template.fill(time_ns)


def sphere(name: str, position: Point, diameter_m: float, colour: Colour, number: int = 0) -> Marker:
    return Marker(name, number, SPHERE, (diameter_m,) * 3, colour, position)


def disc(name: str, position: Point, diameter_m: float, colour: Colour, number: int = 0) -> Marker:
    return Marker(name, number, CYLINDER, (diameter_m, diameter_m, WIDTH_M), colour, position)


def line(name: str, points: Sequence[Point], colour: Colour, number: int = 0) -> Marker:
    return Marker(name, number, LINE_STRIP, (WIDTH_M, 0.0, 0.0), colour, points=points)


def arrow(name: str, start: Point, end: Point, colour: Colour, number: int = 0) -> Marker:
    size = (WIDTH_M, 2.0 * WIDTH_M, 3.0 * WIDTH_M)  # of shaft, head, head's length
    return Marker(name, number, ARROW, size, colour, points=(start, end))
