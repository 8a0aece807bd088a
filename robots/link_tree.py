"""The robot's tree of links for ROS (REP 103, 105, 120). A link has the frame of the joint that moves it."""

from collections.abc import Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.common.rotations import rotation_matrix
from footfall.robots.description import Robot
from footfall.robots.mjcf import load_spec

BASE, IMU = "base_link", "imu_link"
SOLE = "{}_sole"  # mean of a foot's geoms, in the axes of its last link
FIXED, REVOLUTE, CONTINUOUS, PRISMATIC = "fixed", "revolute", "continuous", "prismatic"


class Link(NamedTuple):
    """A link and the joint that holds it. The link's origin is on the joint's axis."""

    name: str
    parent: str = ""  # empty for the root
    joint: str = ""
    kind: str = FIXED
    position: np.ndarray = np.zeros(3)  # m, of the joint in the parent's frame, (3,)
    rotation: np.ndarray = np.eye(3)  # from the link's to the parent's frame, joint at zero, (3, 3)
    axis: np.ndarray = np.zeros(3)  # in the link's frame, (3,)
    body: int = -1  # id of its MuJoCo body; -1 for a frame without a body
    body_origin: np.ndarray = np.zeros(3)  # m, of that body in the link's frame, (3,)


def load_model(robot: Robot) -> mujoco.MjModel:
    """The compiled MJCF of a robot's folder, unchanged."""
    return load_spec(robot.xml_path).compile()


def link_tree(robot: Robot, model: mujoco.MjModel) -> tuple[Link, ...]:
    """Links from the root outwards, parents first: `base_link`, the bodies, the IMU and the soles.

    `base_link` is a frame without mass, as `robot_state_publisher` requires for its root; the base's body is
    fixed to it. A body with several joints becomes several links.

    Args:
        robot: the robot.
        model: its MJCF, see `load_model`.

    Raises:
        UserError: a body has a ball joint, or a body other than the base is free.
    """
    base = model.body(robot.description.base).id
    links = [Link(BASE), _base_body(robot.description.base, base)]
    link_of_body = {base: links[-1]}  # of several links, the last one: it has the mass
    for body in range(base + 1, model.nbody):  # parents come first
        parent_link = link_of_body.get(int(model.body_parentid[body]))
        if parent_link is not None:
            added = list(_links_of(model, body, parent_link))
            link_of_body[body] = added[-1]
            links += added
    site = model.site(robot.description.imu)
    links.append(
        Link(IMU, BASE, f"{IMU}_joint", position=site.pos.copy(), rotation=rotation_matrix(site.quat))
    )
    for foot in robot.description.feet:
        geoms = [model.geom(name).id for name in foot.geoms]
        end = link_of_body[int(model.geom_bodyid[geoms[0]])]
        position = end.body_origin + model.geom_pos[geoms].mean(axis=0)
        name = SOLE.format(foot.name)
        links.append(Link(name, end.name, f"{name}_joint", position=position))
    return tuple(links)


def _base_body(name: str, body: int) -> Link:
    link_name = f"{BASE}_inertia" if name == BASE else name
    return Link(link_name, BASE, f"{link_name}_fixed", body=body)


def _links_of(model: mujoco.MjModel, body: int, parent_link: Link) -> Iterator[Link]:
    """The links of a body, one for each of its joints; all except the last are without mass."""
    start, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    name, offset = model.body(body).name or f"body_{body}", parent_link.body_origin + model.body_pos[body]
    body_rotation = rotation_matrix(model.body_quat[body])
    if not count:
        yield Link(
            name, parent_link.name, f"{name}_fixed", position=offset, rotation=body_rotation, body=body
        )
        return
    # `origin` is the body's origin in the frame in which the next joint is placed.
    parent, origin = parent_link.name, np.zeros(3)
    for joint in range(start, start + count):
        is_last = joint == start + count - 1
        joint_name = model.joint(joint).name or f"{name}_joint_{joint - start}"
        kind, axis = _kind(model, joint, joint_name), model.jnt_axis[joint].copy()
        anchor, reference = model.jnt_pos[joint], model.qpos0[model.jnt_qposadr[joint]]
        position, joint_rotation = offset + body_rotation @ (origin + anchor), body_rotation
        if kind == PRISMATIC:
            position = position - body_rotation @ axis * reference
        else:
            joint_rotation = body_rotation @ _rotation_about(axis, -reference)
        yield Link(
            name if is_last else f"{name}_{joint_name}",
            parent,
            joint_name,
            kind,
            position,
            joint_rotation,
            axis,
            body if is_last else -1,
            -anchor if is_last else np.zeros(3),
        )
        parent, origin, offset, body_rotation = f"{name}_{joint_name}", -anchor, np.zeros(3), np.eye(3)


def _kind(model: mujoco.MjModel, joint: int, name: str) -> str:
    match model.jnt_type[joint]:
        case mujoco.mjtJoint.mjJNT_HINGE:
            return REVOLUTE if model.jnt_limited[joint] else CONTINUOUS
        case mujoco.mjtJoint.mjJNT_SLIDE:
            return PRISMATIC
    raise UserError(f"joint {name} is neither a hinge nor a slide: a URDF has no such joint")


def _rotation_about(axis: np.ndarray, angle_rad: float) -> np.ndarray:
    quaternion = np.empty(4)
    mujoco.mju_axisAngle2Quat(quaternion, axis, angle_rad)
    return rotation_matrix(quaternion)
