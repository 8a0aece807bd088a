"""Geometry of the default pose: height of the base and positions of the feet."""

from itertools import product

import mujoco
import numpy as np

from footfall.robots.robot_yaml import Description


def in_default_pose(model: mujoco.MjModel, description: Description) -> mujoco.MjData:
    """A model in the robot's default pose, its base level and at the origin, with `mj_kinematics` done.

    Joints that `robot.yaml` does not list keep their initial position of the MJCF.

    Args:
        model: model with the robot's joint names; its first free joint belongs to the base.
        description: description of the robot.
    """
    return _in_pose(model, {joint.name: joint.default_rad for joint in description.joints})


def touching_height(description: Description, model: mujoco.MjModel) -> float:
    """Height of the base's origin, m, at which the lowest foot touches the ground in the default pose."""
    return -float(lowest_points(description, model).min())


def lowest_points(description: Description, model: mujoco.MjModel) -> np.ndarray:
    """Height of each foot's lowest point over the base's origin in the default pose, m, (feet,)."""
    return _lowest_of_feet(description, model, in_default_pose(model, description))


def lying_clearance(description: Description, model: mujoco.MjModel) -> float:
    """Height of the level base above its lowest foot in the lying pose, m; negative: feet in the air.

    Every joint must have a `lying_rad`.
    """
    pose = {joint.name: joint.lying_rad for joint in description.joints if joint.lying_rad is not None}
    lowest = float(_lowest_of_feet(description, model, _in_pose(model, pose)).min())
    return -base_below(description, model) - lowest


def _in_pose(model: mujoco.MjModel, pose: dict[str, float]) -> mujoco.MjData:
    """A model with its base level and at the origin and its joints at these angles, rad."""
    data = mujoco.MjData(model)
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0]
    at = model.jnt_qposadr[free]
    data.qpos[at : at + 7] = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    for name, angle in pose.items():
        data.qpos[model.joint(name).qposadr] = angle
    mujoco.mj_kinematics(model, data)
    return data


def _lowest_of_feet(description: Description, model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    lowest = [[_lowest_point(model, data, model.geom(n).id) for n in foot.geoms] for foot in description.feet]
    return np.array([min(each) for each in lowest])


def base_below(description: Description, model: mujoco.MjModel) -> float:
    """Depth of the level base below its origin, m; 0 for a base without collision geometry."""
    return -float(base_corners(description, model)[:, 2].min())


def base_corners(description: Description, model: mujoco.MjModel) -> np.ndarray:
    """Corners of the box around the collision geometry of the base, m, base frame, (8, 3).

    Without collision geometry all corners are the origin.
    """
    data = in_default_pose(model, description)
    free = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0]
    solid = (model.geom_contype | model.geom_conaffinity) > 0
    geoms = np.flatnonzero(solid & (model.geom_bodyid == model.jnt_bodyid[free])).tolist()
    sides = [
        [sign * max((_extent(model, data, geom, sign * axis) for geom in geoms), default=0.0)
         for sign in (-1.0, 1.0)]
        for axis in np.eye(3)
    ]  # fmt: skip
    return np.array(list(product(*sides)))


def foot_positions(description: Description, model: mujoco.MjModel) -> np.ndarray:
    """Middle of each foot's geoms in the default pose, m, base frame, (feet, 3)."""
    data = in_default_pose(model, description)
    positions = [[data.geom(name).xpos for name in foot.geoms] for foot in description.feet]
    return np.array([np.mean(each, axis=0) for each in positions])


def _lowest_point(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Height of a geom's lowest point, m."""
    return -_extent(model, data, geom, np.array([0.0, 0.0, -1.0]))


def _extent(model: mujoco.MjModel, data: mujoco.MjData, geom: int, direction: np.ndarray) -> float:
    """Extent of a geom from the world's origin along a unit vector (3,) in the world, m."""
    size = model.geom_size[geom]
    along = direction @ data.geom_xmat[geom].reshape(3, 3)  # the direction in the geom's axes
    kinds = mujoco.mjtGeom
    match model.geom_type[geom]:
        case kinds.mjGEOM_SPHERE:
            reach = size[0]
        case kinds.mjGEOM_CAPSULE:
            reach = size[0] + size[1] * abs(along[2])
        case kinds.mjGEOM_CYLINDER:
            reach = size[0] * np.hypot(along[0], along[1]) + size[1] * abs(along[2])
        case kinds.mjGEOM_ELLIPSOID:
            reach = np.linalg.norm(size * along)
        case kinds.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            start = model.mesh_vertadr[mesh]
            reach = (model.mesh_vert[start : start + model.mesh_vertnum[mesh]] @ along).max()
        case _:
            reach = np.abs(size * along).sum()  # a box
    return float(data.geom_xpos[geom] @ direction + reach)
