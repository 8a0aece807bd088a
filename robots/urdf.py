"""A robot's URDF, made from its MJCF: kinematics, masses, limits, and shapes that URDF supports."""

import math
from collections.abc import Iterable
from typing import NamedTuple
from xml.etree import ElementTree

import mujoco
import numpy as np

from footfall.common.rotations import rotation_matrix
from footfall.robots.description import Robot
from footfall.robots.link_tree import FIXED, Link, link_tree, load_model

VISIBLE_GROUPS = 3  # geoms of groups 0, 1 and 2 are visible, as in MuJoCo's viewer
NOISE = 1e-12  # rounding error of a zero coordinate
LOCKED = 1e-9  # cosine of the pitch below which roll and yaw have the same axis (gimbal lock)
MOMENTS = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}
CAPSULES, BOXES = "Ellipsoids drawn as capsules", "Shapes drawn as boxes"
Geom = mujoco.mjtGeom


class _Shape(NamedTuple):
    """A primitive in the frame of its geom."""

    tag: str
    sizes: dict[str, str]
    position: np.ndarray  # (3,) m
    rotation: np.ndarray  # (3, 3)


def urdf(robot: Robot) -> str:
    """The robot's URDF, as text.

    Links and joints keep their names of the MJCF, below `base_link`; see `link_tree`. A capsule becomes a
    cylinder and two spheres. An ellipsoid becomes the capsule along its longest axis, its radius the
    geometric mean of the other two semi-axes. Any other shape becomes the box around it. The comment at the
    top lists the links with such approximations. URDF has no reflected inertia (armature).

    Raises:
        UserError: the robot has a joint that URDF does not support.
    """
    model = load_model(robot)
    links = link_tree(robot, model)
    root = ElementTree.Element("robot", name=robot.name)
    root.append(ElementTree.Comment(_comment(robot, model, links)))
    for link in links:
        _add_link(root, robot, model, link)
    for link in links[1:]:
        _add_joint(root, robot, model, link)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _comment(robot: Robot, model: mujoco.MjModel, links: Iterable[Link]) -> str:
    """The source of the file, and the links with approximated shapes."""
    approximated: dict[str, list[str]] = {CAPSULES: [], BOXES: []}
    for link in links:
        for geom in _geoms(model, link.body):
            kind = model.geom_type[geom]
            if kind == Geom.mjGEOM_ELLIPSOID:
                approximated[CAPSULES].append(link.name)
            elif kind not in _PRIMITIVES:
                approximated[BOXES].append(link.name)
    notes = [f"{what}: {', '.join(dict.fromkeys(names))}." for what, names in approximated.items() if names]
    return " ".join([f" Made from {robot.description.model} of {robot.name}.", *notes, ""])


def _add_link(root: ElementTree.Element, robot: Robot, model: mujoco.MjModel, link: Link) -> None:
    element = ElementTree.SubElement(root, "link", name=link.name)
    if link.body < 0:
        return
    if model.body_mass[link.body] > 0.0:
        _add_inertial(element, model, link)
    solid = _solid_geoms(robot, model)
    for geom in _geoms(model, link.body):
        if model.geom_group[geom] < VISIBLE_GROUPS:
            _add_shapes(element, "visual", model, geom, link)
        if geom in solid:
            _add_shapes(element, "collision", model, geom, link)


def _add_inertial(element: ElementTree.Element, model: mujoco.MjModel, link: Link) -> None:
    """The mass and the inertia about its centre, in the link's axes."""
    axes = rotation_matrix(model.body_iquat[link.body])
    inertia = axes @ np.diag(model.body_inertia[link.body]) @ axes.T
    inertial = ElementTree.SubElement(element, "inertial")
    _add_origin(inertial, link.body_origin + model.body_ipos[link.body], np.eye(3))
    ElementTree.SubElement(inertial, "mass", value=_text(model.body_mass[link.body]))
    moments = {name: _text(inertia[index]) for name, index in MOMENTS.items()}
    ElementTree.SubElement(inertial, "inertia", moments)


def _add_joint(root: ElementTree.Element, robot: Robot, model: mujoco.MjModel, link: Link) -> None:
    element = ElementTree.SubElement(root, "joint", name=link.joint, type=link.kind)
    ElementTree.SubElement(element, "parent", link=link.parent)
    ElementTree.SubElement(element, "child", link=link.name)
    _add_origin(element, link.position, link.rotation)
    if link.kind == FIXED:
        return
    ElementTree.SubElement(element, "axis", xyz=_text(*link.axis))
    joint = model.joint(link.joint)
    lower, upper = joint.range
    effort_nm, speed_rad_s = _motor_limits(robot, link.joint)
    ElementTree.SubElement(
        element,
        "limit",
        lower=_text(lower),
        upper=_text(upper),
        effort=_text(effort_nm),
        velocity=_text(speed_rad_s),
    )
    dof = joint.dofadr[0]
    damping, friction = model.dof_damping[dof], model.dof_frictionloss[dof]
    ElementTree.SubElement(element, "dynamics", damping=_text(damping), friction=_text(friction))


def _motor_limits(robot: Robot, joint: str) -> tuple[float, float]:
    """Peak torque, N m, and no-load speed, rad/s, of a joint; zeros for a joint without a motor."""
    if joint not in robot.joint_names:
        return 0.0, 0.0
    index = robot.joint_index(joint)
    return float(robot.motor.peak_torque[index]), float(robot.motor.no_load_speed[index])


def _geoms(model: mujoco.MjModel, body: int) -> range:
    """Ids of a body's geoms; none for -1."""
    if body < 0:
        return range(0)
    return range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])


def _solid_geoms(robot: Robot, model: mujoco.MjModel) -> set[int]:
    """Geoms that can touch the ground: by their bits, or as feet."""
    feet = {model.geom(name).id for foot in robot.description.feet for name in foot.geoms}
    return feet.union(np.flatnonzero(model.geom_contype | model.geom_conaffinity).tolist())


def _add_shapes(
    link_element: ElementTree.Element, purpose: str, model: mujoco.MjModel, geom: int, link: Link
) -> None:
    """Add a geom as `visual` or `collision` elements, one for each primitive."""
    position, rotation = link.body_origin + model.geom_pos[geom], rotation_matrix(model.geom_quat[geom])
    for shape in _shapes(model, geom):
        element = ElementTree.SubElement(link_element, purpose)
        _add_origin(element, position + rotation @ shape.position, rotation @ shape.rotation)
        ElementTree.SubElement(ElementTree.SubElement(element, "geometry"), shape.tag, shape.sizes)
        if purpose == "visual":
            colour = _colour(model, geom)
            name = "rgba_" + "_".join(f"{round(255 * part)}" for part in colour)
            ElementTree.SubElement(
                ElementTree.SubElement(element, "material", name=name), "color", rgba=_text(*colour)
            )


def _colour(model: mujoco.MjModel, geom: int) -> np.ndarray:
    material = model.geom_matid[geom]
    return model.geom_rgba[geom] if material < 0 else model.mat_rgba[material]


def _shapes(model: mujoco.MjModel, geom: int) -> list[_Shape]:
    size = model.geom_size[geom]
    primitive = _PRIMITIVES.get(int(model.geom_type[geom]))
    if primitive is not None:
        return primitive(size)
    if model.geom_type[geom] == Geom.mjGEOM_ELLIPSOID:
        return _ellipsoid(size)
    middle, half = np.split(model.geom_aabb[geom], 2)
    return [shape._replace(position=middle) for shape in _box(half)]


def _sphere(size: np.ndarray) -> list[_Shape]:
    return [_Shape("sphere", {"radius": _text(size[0])}, np.zeros(3), np.eye(3))]


def _cylinder(size: np.ndarray) -> list[_Shape]:
    sizes = {"radius": _text(size[0]), "length": _text(2 * size[1])}
    return [_Shape("cylinder", sizes, np.zeros(3), np.eye(3))]


def _box(size: np.ndarray) -> list[_Shape]:
    return [_Shape("box", {"size": _text(*(2 * size))}, np.zeros(3), np.eye(3))]


def _capsule(size: np.ndarray) -> list[_Shape]:
    ends = [_sphere(size)[0]._replace(position=np.array([0.0, 0.0, end])) for end in (-size[1], size[1])]
    return [*_cylinder(size), *ends]


def _ellipsoid(size: np.ndarray) -> list[_Shape]:
    """The capsule that approximates an ellipsoid with these semi-axes."""
    longest = int(size.argmax())
    radius = math.sqrt(np.delete(size, longest).prod())
    axes = np.roll(np.eye(3), longest + 1, axis=1)  # z of the capsule along the longest axis
    capsule = _capsule(np.array([radius, size[longest] - radius]))
    return [
        shape._replace(position=axes @ shape.position, rotation=axes @ shape.rotation) for shape in capsule
    ]


_PRIMITIVES = {
    int(Geom.mjGEOM_SPHERE): _sphere,
    int(Geom.mjGEOM_CAPSULE): _capsule,
    int(Geom.mjGEOM_CYLINDER): _cylinder,
    int(Geom.mjGEOM_BOX): _box,
}


def _add_origin(element: ElementTree.Element, position: np.ndarray, rotation: np.ndarray) -> None:
    ElementTree.SubElement(element, "origin", xyz=_text(*position), rpy=_text(*_angles(rotation)))


def _angles(rotation: np.ndarray) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation, even at a pitch of ±90 degrees."""
    cosine = math.hypot(rotation[2, 1], rotation[2, 2])
    pitch = math.atan2(-rotation[2, 0], cosine)
    if cosine < LOCKED:
        return math.atan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0
    return (
        math.atan2(rotation[2, 1], rotation[2, 2]),
        pitch,
        math.atan2(rotation[1, 0], rotation[0, 0]),
    )


def _text(*numbers: float) -> str:
    return " ".join(f"{0.0 if abs(number) < NOISE else number:.9g}" for number in numbers)
