"""Writes a machine as MJCF, in primitive geometry."""

from collections.abc import Iterable, Iterator
from xml.sax.saxutils import quoteattr

import numpy as np

from footfall.robots.importer.machine import Geom, Hinge, Kind, Link, Machine

IMU = "imu"
KINDS = {
    Kind.mjGEOM_SPHERE: ("sphere", 1),
    Kind.mjGEOM_CAPSULE: ("capsule", 2),
    Kind.mjGEOM_CYLINDER: ("cylinder", 2),
    Kind.mjGEOM_BOX: ("box", 3),
    Kind.mjGEOM_ELLIPSOID: ("ellipsoid", 3),
}
COLOURS = {"base": "0.78 0.80 0.83 1", "link": "0.45 0.48 0.53 1", "foot": "0.10 0.10 0.11 1"}
FOOT_FRICTION = 0.8


LEG_CLASS = [
    '    <default class="leg">',
    "      <!-- Legs collide with each other only through the pairs below. -->",
    '      <geom group="3" contype="0" conaffinity="0"/>',
    "    </default>",
]


def model_xml(
    machine: Machine,
    height_m: float = 0.0,
    not_colliding: Iterable[tuple[str, str]] = (),
    pairs: Iterable[tuple[str, str]] = (),
    notes: Iterable[str] = (),
) -> str:
    """The text of an MJCF.

    Args:
        machine: the robot.
        height_m: height of the base above the ground.
        not_colliding: pairs of links that do not collide.
        pairs: names of geoms that always collide, in pairs.
        notes: lines of the comment at the top.
    """
    comment = "\n     ".join(note.replace("--", "- -") for note in notes)
    feet = {geom for leg in machine.legs for geom in leg.geoms}
    contact = [f"    <exclude body1={quoteattr(a)} body2={quoteattr(b)}/>" for a, b in not_colliding]
    contact += [f'    <pair geom1={quoteattr(a)} geom2={quoteattr(b)} condim="1"/>' for a, b in pairs]
    lines = [
        *([f"<!-- {comment} -->"] if comment else []),
        f"<mujoco model={quoteattr(machine.name)}>",
        '  <compiler angle="radian" autolimits="true"/>',
        '  <option timestep="0.002" cone="elliptic" impratio="10"/>',
        "  <default>",
        '    <geom density="0" condim="3"/>',
        '    <default class="foot">',
        "      <!-- A foot's friction takes priority over the ground's. -->",
        f'      <geom priority="1" rgba="{COLOURS["foot"]}"/>',
        "    </default>",
        *(LEG_CLASS if any(_touches_by_pair(geom) for link in machine.links for geom in link.geoms) else []),
        "  </default>",
        "  <worldbody>",
        *(f"    {line}" for line in _link(machine, 0, height_m, feet)),
        "  </worldbody>",
        *(["  <contact>", *contact, "  </contact>"] if contact else []),
        "</mujoco>",
    ]
    return "\n".join(lines) + "\n"


def _link(machine: Machine, index: int, height_m: float, feet: set[str]) -> Iterator[str]:
    link = machine.links[index]
    is_base = index == 0
    position = f"0 0 {height_m:.6g}" if is_base else _numbers(link.position)
    rotation = "" if is_base else _rotation(link.quaternion)
    yield f'<body name={quoteattr(link.name)} pos="{position}"{rotation}>'
    if is_base:
        yield '  <freejoint name="floating_base"/>'
    yield f"  {_inertial(link)}"
    for hinge in link.hinges:
        yield f"  {_joint(hinge)}"
    if is_base:
        yield f'  <site name="{IMU}" pos="{_numbers(machine.imu)}" size="0.01" group="4"/>'
    for geom in link.geoms:
        yield f"  {_geom(geom, geom.name in feet, is_base)}"
    for child, other in enumerate(machine.links):
        if other.parent == index:
            yield from (f"  {line}" for line in _link(machine, child, height_m, feet))
    yield "</body>"


def _inertial(link: Link) -> str:
    i = link.inertia
    full = _numbers(np.array([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]), 9)
    return f'<inertial mass="{link.mass:.6g}" pos="{_numbers(link.centre)}" fullinertia="{full}"/>'


def _joint(hinge: Hinge) -> str:
    optional = {
        "pos": "" if not hinge.anchor.any() else _numbers(hinge.anchor),
        "axis": _numbers(hinge.axis),
        "range": f"{hinge.low:.6g} {hinge.high:.6g}",
        "ref": "" if hinge.zero == 0.0 else f"{hinge.zero:.6g}",
        "armature": "" if hinge.armature == 0.0 else f"{hinge.armature:.4g}",
        "frictionloss": "" if hinge.friction == 0.0 else f"{hinge.friction:.4g}",
        "damping": "" if hinge.damping == 0.0 else f"{hinge.damping:.4g}",
    }
    given = " ".join(f'{name}="{value}"' for name, value in optional.items() if value)
    return f"<joint name={quoteattr(hinge.name)} {given}/>"


def _geom(geom: Geom, is_foot: bool, of_base: bool) -> str:
    kind, sizes = KINDS[geom.shape.kind]
    size = _numbers(geom.shape.size[:sizes])
    look = f'rgba="{COLOURS["base" if of_base else "link"]}"'
    attributes = (
        f'name={quoteattr(geom.name)} class="foot" friction="{geom.friction:.4g}"' if is_foot else look
    )
    touch = ""
    if _touches_by_pair(geom):
        attributes = f'name={quoteattr(geom.name)} class="leg"'
    elif (geom.contype, geom.conaffinity) != (1, 1):
        touch = f' contype="{geom.contype}" conaffinity="{geom.conaffinity}"'
    pose = f'pos="{_numbers(geom.shape.position)}"{_rotation(geom.shape.quaternion)}'
    return f'<geom {attributes} type="{kind}" size="{size}" {pose}{touch}/>'


def _touches_by_pair(geom: Geom) -> bool:
    """Whether a geom collides only with the geoms that it is paired with."""
    return not (geom.contype or geom.conaffinity)


def _rotation(quaternion: np.ndarray) -> str:
    return "" if abs(quaternion[0]) > 1 - 1e-9 else f' quat="{_numbers(quaternion)}"'


def _numbers(values: np.ndarray, digits: int = 6) -> str:
    """Numbers with at most `digits` digits, without minus zero."""
    return " ".join(f"{round(float(value), digits) + 0.0:.{digits}g}" for value in values)
