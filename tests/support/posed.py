"""MuJoCo's data of robots in given poses."""

from collections.abc import Iterable

import mujoco
import numpy as np

from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses


def posed(
    model: mujoco.MjModel, robot: Robot, height_m: float, pose: np.ndarray | None = None
) -> mujoco.MjData:
    """The data with a level base at a height and the joints in a pose (n,), by default the default pose."""
    data = mujoco.MjData(model)
    data.qpos[:7] = (0, 0, height_m, 1, 0, 0, 0)
    data.qpos[joint_addresses(model, robot)[0]] = robot.default_pose if pose is None else pose
    mujoco.mj_forward(model, data)
    return data


def mass_matrix(
    model: mujoco.MjModel, data: mujoco.MjData, joints: Iterable[str] | None = None
) -> np.ndarray:
    """The mass matrix, base first, then these joints in this order, by default the model's."""
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    if joints is None:
        return full
    order = [*range(6), *(int(model.joint(name).dofadr[0]) for name in joints)]
    return full[np.ix_(order, order)]
