"""Places the simulated robot on the ground before an episode."""

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.plant.sensors import Layout
from footfall.robots.description import Robot

SEARCH_HEIGHT_M = 4.0  # largest height of the ground above or below the origin


def initial_pose(robot: Robot, lying: bool) -> np.ndarray:
    """Initial joint positions, rad, (n,); raises UserError for `lying` without a lying pose."""
    if not lying:
        return robot.default_pose
    if robot.lying_pose is None:
        raise UserError(f"robot '{robot.name}' cannot lie: its joints have no lying_rad in robot.yaml")
    return robot.lying_pose


def put_down(
    robot: Robot, model: mujoco.MjModel, data: mujoco.MjData, layout: Layout, pose: np.ndarray
) -> None:
    """Place the robot upright in a pose (n,) so that its lowest part touches the ground.

    Lowers it until it touches, then bisects. Raises UserError if there is no ground below.
    """
    at = layout.base_qpos
    data.qpos[layout.qpos] = pose
    data.qpos[at + 3 : at + 7] = (1.0, 0.0, 0.0, 0.0)

    def touches_at(height_m: float) -> bool:
        data.qpos[at + 2] = height_m
        mujoco.mj_fwdPosition(model, data)
        bodies = model.geom_bodyid[data.contact.geom]
        return bool(((bodies == 0).any(axis=1) & (data.contact.dist <= 0.0)).any())

    stride = robot.description.standing_height_m / 4
    heights = np.arange(SEARCH_HEIGHT_M, -SEARCH_HEIGHT_M, -stride)
    touching = next((height for height in heights if touches_at(height)), None)
    if touching is None:
        raise UserError(f"the plant has no ground within {SEARCH_HEIGHT_M:g} m of its origin to stand on")
    low, high = touching, touching + stride
    for _ in range(25):
        middle = (low + high) / 2
        low, high = (middle, high) if touches_at(middle) else (low, middle)
    data.qpos[at + 2] = low
    mujoco.mj_forward(model, data)
