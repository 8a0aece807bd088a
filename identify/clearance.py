"""How far a robot on a stand can swing its legs before its bodies touch each other."""

from collections.abc import Callable

import mujoco
import numpy as np

from footfall.robots.description import Robot
from footfall.robots.model import joint_addresses, plant_model

MAX_DISTANCE_M = 0.003  # bodies farther apart than this do not count
SLACK_M = 0.002  # allowed decrease of the distance by the swing's targets, because legs lag behind targets
SHARES = (1.0, 0.75, 0.5, 0.25)


def clear_share(robot: Robot, poses: Callable[[float], np.ndarray]) -> float:
    """Largest of `SHARES` that brings the robot's bodies no nearer to each other; 0 if none does.

    Args:
        robot: robot in the air.
        poses: joint positions, (T, n), for a share of the swing.
    """
    model = plant_model(robot)
    model.geom_margin[model.geom_bodyid > 0] = MAX_DISTANCE_M / 2
    data = mujoco.MjData(model)
    qpos_addresses, _ = joint_addresses(model, robot)

    def min_distance_m(pose: np.ndarray) -> float:
        data.qpos[qpos_addresses] = pose
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        between_bodies = (model.geom_bodyid[data.contact.geom] > 0).all(axis=1)
        return float(data.contact.dist[between_bodies].min(initial=MAX_DISTANCE_M))

    limit_m = min(map(min_distance_m, poses(0.0))) - SLACK_M
    return next((share for share in SHARES if min(map(min_distance_m, poses(share))) >= limit_m), 0.0)
