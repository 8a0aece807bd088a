"""A legged machine as plain data, taken from a URDF or MJCF."""

from dataclasses import dataclass, replace
from pathlib import Path

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.importer.shapes import Shape, fit_shape, quaternion_of, rotation_of
from footfall.robots.importer.source import Source

Kind = mujoco.mjtGeom
MIN_MASS_KG = 1e-6  # of a moving link
PRIMITIVES = (
    Kind.mjGEOM_SPHERE,
    Kind.mjGEOM_CAPSULE,
    Kind.mjGEOM_CYLINDER,
    Kind.mjGEOM_BOX,
    Kind.mjGEOM_ELLIPSOID,
)


@dataclass(frozen=True)
class Hinge:
    """A driven joint, in the frame of the link that it moves."""

    name: str
    axis: np.ndarray  # (3,)
    anchor: np.ndarray  # (3,) m
    low: float  # rad
    high: float
    zero: float  # rad, angle at which the links are placed as in the file
    armature: float  # reflected inertia, kg m^2; 0 if the file gives none
    damping: float  # N m s/rad
    friction: float  # N m


@dataclass(frozen=True)
class Geom:
    """A collision shape."""

    name: str
    shape: Shape
    friction: float
    contype: int
    conaffinity: int
    of_body: str  # name of its body in the source file
    points: np.ndarray | None = None  # (k, 3) m, hull of the mesh that this shape replaces


@dataclass(frozen=True)
class Link:
    """A rigid body, with all bodies that are fixed to it."""

    name: str
    parent: int  # index of the parent link; the base, link 0, has -1
    position: np.ndarray  # (3,) m, in the parent's frame, all joints at their zeros
    quaternion: np.ndarray  # (4,) w x y z
    mass: float  # kg
    centre: np.ndarray  # (3,) m, of mass
    inertia: np.ndarray  # (3, 3) kg m^2, about the centre of mass, along the link's axes
    hinges: tuple[Hinge, ...]
    geoms: tuple[Geom, ...]


@dataclass(frozen=True)
class Leg:
    """A limb that ends in a foot."""

    name: str
    joints: tuple[str, ...]  # that only this leg has, from the base outwards
    link: int  # index of the link that carries the foot
    geoms: tuple[str, ...]  # that the foot stands on


@dataclass(frozen=True)
class Machine:
    """A tree of links, parents before children, on a floating base."""

    name: str
    links: tuple[Link, ...]
    legs: tuple[Leg, ...]
    imu: np.ndarray  # (3,) m, in the base's frame

    @property
    def hinges(self) -> tuple[Hinge, ...]:
        return tuple(hinge for link in self.links for hinge in link.hinges)

    @property
    def mass(self) -> float:
        return sum(link.mass for link in self.links)

    @property
    def stands_still(self) -> bool:
        """Whether its feet touch the ground at three or more points, which span an area."""
        return sum(len(leg.geoms) for leg in self.legs) > 2

    def with_hinges(self, hinges: dict[str, Hinge]) -> "Machine":
        """The machine with some hinges replaced, by name."""
        links = [replace(li, hinges=tuple(hinges.get(h.name, h) for h in li.hinges)) for li in self.links]
        return replace(self, links=tuple(links))


def build_links(source: Source, base: int, driven: set[str]) -> tuple[Link, ...]:
    """The links of the tree under body `base`. Bodies without a driven joint become part of their parent.

    Joints that are not driven stay at zero, or at the end of their range nearest to zero.
    """
    model = source.model
    data = pose_of(model, frozen_pose(model, driven))
    ids = {j for j in range(model.njnt) if model.joint(j).name in driven}
    tops = {int(model.jnt_bodyid[j]) for j in ids} | {base}
    top_of: dict[int, int] = {}
    for body in range(base, model.nbody):
        if body in tops:
            top_of[body] = body
        elif int(model.body_parentid[body]) in top_of:
            top_of[body] = top_of[int(model.body_parentid[body])]
    order = sorted(tops)
    links = []
    for top in order:
        members = [body for body, its_top in top_of.items() if its_top == top]
        parent = -1 if top == base else order.index(top_of[int(model.body_parentid[top])])
        links.append(_link(source, data, top, members, parent, None if parent < 0 else order[parent], ids))
    return _without_massless(links, source.path)


def _without_massless(links: list[Link], path: Path) -> tuple[Link, ...]:
    """Move the joints of a link without mass to its only child.

    Several joints of a link turn it one after the other, the first outermost, so nothing else changes.
    """
    while (index := next((i for i, link in enumerate(links) if link.mass < MIN_MASS_KG), None)) is not None:
        massless = links[index]
        children = [i for i, link in enumerate(links) if link.parent == index]
        if len(children) != 1 or massless.parent < 0 or massless.geoms:
            raise UserError(f"{path}: link {massless.name} moves and has no mass: give it an inertia")
        links[children[0]] = _joined(massless, links[children[0]])
        links = [
            replace(link, parent=link.parent - (link.parent > index))
            for i, link in enumerate(links)
            if i != index
        ]
    return tuple(links)


def _joined(massless: Link, link: Link) -> Link:
    """A link with the joints and the parent of the massless link that carries it."""
    outer, inner = rotation_of(massless.quaternion), rotation_of(link.quaternion)
    moved = tuple(
        replace(hinge, axis=inner.T @ hinge.axis, anchor=inner.T @ (hinge.anchor - link.position))
        for hinge in massless.hinges
    )
    return replace(
        link,
        parent=massless.parent,
        position=massless.position + outer @ link.position,
        quaternion=quaternion_of(outer @ inner),
        hinges=(*moved, *link.hinges),
    )


def frozen_pose(model: mujoco.MjModel, driven: set[str]) -> np.ndarray:
    """`qpos` with driven joints as in the file and the others as near to zero as possible."""
    pose = model.qpos0.copy()
    plain = np.isin(model.jnt_type, (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE))
    for joint in np.flatnonzero(plain & model.jnt_limited.astype(bool)).tolist():
        if model.joint(joint).name not in driven:
            pose[model.jnt_qposadr[joint]] = np.clip(0.0, *model.jnt_range[joint])
    return pose


def pose_of(model: mujoco.MjModel, qpos: np.ndarray) -> mujoco.MjData:
    """The model in a pose, with kinematics computed."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return data


def geom_shape(source: Source, geom: int) -> Shape | None:
    """A geom as a primitive in its body's frame; None if it cannot collide, is a plane or a height field."""
    model = source.model
    if not (model.geom_contype[geom] or model.geom_conaffinity[geom]):
        return None
    if (points := source.meshes.get(model.geom(geom).name)) is not None:
        return fit_shape(points)[0]
    kind = Kind(model.geom_type[geom])
    if kind not in PRIMITIVES:
        return None
    size, position, quaternion = model.geom_size[geom], model.geom_pos[geom], model.geom_quat[geom]
    return Shape(kind, size.copy(), position.copy(), quaternion.copy())


def _link(
    source: Source,
    data: mujoco.MjData,
    top: int,
    members: list[int],
    parent: int,
    parent_body: int | None,
    driven: set[int],
) -> Link:
    model = source.model
    rotation, origin = data.xmat[top].reshape(3, 3), data.xpos[top]
    mass = float(model.body_mass[members].sum())
    centre = model.body_mass[members] @ data.xipos[members] / max(mass, 1e-12)
    inertia = sum((_inertia_about(model, data, body, centre) for body in members), np.zeros((3, 3)))
    position, quaternion = np.zeros(3), np.array([1.0, 0, 0, 0])
    if parent_body is not None:
        parent_axes = data.xmat[parent_body].reshape(3, 3)
        position = parent_axes.T @ (origin - data.xpos[parent_body])
        quaternion = quaternion_of(parent_axes.T @ rotation)
    return Link(
        name=model.body(top).name,
        parent=parent,
        position=position,
        quaternion=quaternion,
        mass=mass,
        centre=rotation.T @ (centre - origin),
        inertia=rotation.T @ inertia @ rotation,
        hinges=tuple(_hinge(model, joint) for joint in sorted(driven) if model.jnt_bodyid[joint] == top),
        geoms=tuple(_geoms(source, data, members, rotation, origin)),
    )


def _inertia_about(model: mujoco.MjModel, data: mujoco.MjData, body: int, point: np.ndarray) -> np.ndarray:
    """A body's inertia about a point, world axes, (3, 3)."""
    axes, offset = data.ximat[body].reshape(3, 3), data.xipos[body] - point
    parallel = model.body_mass[body] * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return axes @ np.diag(model.body_inertia[body]) @ axes.T + parallel


def _hinge(model: mujoco.MjModel, joint: int) -> Hinge:
    dof = model.jnt_dofadr[joint]
    low, high = model.jnt_range[joint]
    return Hinge(
        name=model.joint(joint).name,
        axis=model.jnt_axis[joint].copy(),
        anchor=model.jnt_pos[joint].copy(),
        low=float(low),
        high=float(high),
        zero=float(model.qpos0[model.jnt_qposadr[joint]]),
        armature=float(model.dof_armature[dof]),
        damping=float(model.dof_damping[dof]),
        friction=float(model.dof_frictionloss[dof]),
    )


def _geoms(
    source: Source, data: mujoco.MjData, members: list[int], rotation: np.ndarray, origin: np.ndarray
) -> list[Geom]:
    model, found = source.model, []
    for geom in np.flatnonzero(np.isin(model.geom_bodyid, members)).tolist():
        shape = geom_shape(source, geom)
        if shape is None:
            continue
        body = int(model.geom_bodyid[geom])
        rotation_in_link = rotation.T @ data.xmat[body].reshape(3, 3)
        link_position = rotation.T @ (data.xpos[body] - origin)
        points = source.meshes.get(model.geom(geom).name)
        found.append(
            Geom(
                name=model.geom(geom).name,
                shape=shape._replace(
                    position=rotation_in_link @ shape.position + link_position,
                    quaternion=quaternion_of(rotation_in_link @ rotation_of(shape.quaternion)),
                ),
                friction=float(model.geom_friction[geom, 0]),
                contype=int(model.geom_contype[geom]) if source.self_collisions else 1,
                conaffinity=int(model.geom_conaffinity[geom]) if source.self_collisions else 1,
                of_body=model.body(body).name,
                points=None if points is None else points @ rotation_in_link.T + link_position,
            )
        )
    return found
