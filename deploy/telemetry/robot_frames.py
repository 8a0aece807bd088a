"""Information about a robot for 3-D views: its URDF, and the links that move with its joints."""

from contextlib import suppress
from typing import Any

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.description import Robot
from footfall.robots.link_tree import Link, link_tree, load_model
from footfall.robots.urdf import urdf


def robot_frames(robot: Robot) -> dict[str, Any]:
    """The robot's `urdf` and `links` (see `Transforms`) for JSON; empty if URDF cannot describe its
    joints."""
    with suppress(UserError):
        links = link_tree(robot, load_model(robot))
        return {"urdf": urdf(robot), "links": [_plain(link, robot) for link in links]}
    return {}


def _plain(link: Link, robot: Robot) -> dict[str, Any]:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, link.rotation.ravel())
    return {
        "name": link.name,
        "parent": link.parent,
        "kind": link.kind,
        "index": robot.joint_index(link.joint) if link.joint in robot.joint_names else None,
        "position": link.position.tolist(),
        "quaternion": quaternion.tolist(),
        "axis": link.axis.tolist(),
    }
