"""Finds the geoms of a model that are the robot's feet, by name or by position."""

from itertools import product
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.robots.mjcf import load_spec
from footfall.robots.robot_yaml import Description, Foot
from footfall.robots.stance import in_default_pose

MAX_OFFSET = 0.25  # largest distance of a foot from its expected position, over the last link's length


class FootSpheres(NamedTuple):
    """The contact surface of a foot: one sphere, or several at the ends and corners of a sole."""

    centre: np.ndarray  # (k, 3) m, in the frame of the limb's last link
    radius: np.ndarray  # (k,) m; 0 for the corner of a box


def foot_geoms(model: mujoco.MjModel, description: Description) -> tuple[np.ndarray, ...]:
    """Geoms that each foot stands on, (k,) ids each, in a model that has all their names."""
    return tuple(np.array([model.geom(name).id for name in foot.geoms]) for foot in description.feet)


def foot_spheres(model: mujoco.MjModel, geoms: np.ndarray, tip: np.ndarray) -> FootSpheres:
    """The spheres of one foot: spheres, both ends of a capsule, or the corners of any other geom's box.

    Args:
        model: compiled.
        geoms: ids of the geoms that it stands on, all of one body.
        tip: (3,) m, origin of the resulting positions, in that body's frame.
    """
    centres, radius = [], []
    for geom in geoms.tolist():
        size = model.geom_size[geom]
        middle, half = np.split(model.geom_aabb[geom], 2)
        match model.geom_type[geom]:
            case mujoco.mjtGeom.mjGEOM_SPHERE:
                offsets, sphere_radius = np.zeros((1, 3)), size[0]
            case mujoco.mjtGeom.mjGEOM_CAPSULE:
                offsets, sphere_radius = np.array([[0.0, 0.0, size[1]], [0.0, 0.0, -size[1]]]), size[0]
            case _:
                offsets, sphere_radius = middle + half * np.array(list(product((-1, 1), repeat=3))), 0.0
        rotation = np.zeros(9)
        mujoco.mju_quat2Mat(rotation, model.geom_quat[geom])
        centres.append(model.geom_pos[geom] - tip + offsets @ rotation.reshape(3, 3).T)
        radius.append(np.full(len(offsets), sphere_radius))
    return FootSpheres(np.concatenate(centres), np.concatenate(radius))


def find_feet(model: mujoco.MjModel, description: Description, own_path: Path) -> tuple[np.ndarray, ...]:
    """Geoms that each foot stands on, (k,) ids each, empty for a foot that is not found.

    A geom is found by its name. If the model does not have the name, candidates are the geoms that can
    collide on the leg's last link and on bodies fixed to it. The result is the candidate nearest to the
    geom's position in the robot's own model, relative to the last joint, in the default pose.

    Args:
        model: compiled, with the robot's joint names.
        description: description of the robot.
        own_path: the robot's own MJCF.
    """
    feet = description.feet
    found = [
        np.array([mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, name) for name in foot.geoms])
        for foot in feet
    ]
    if any((geoms < 0).any() for geoms in found):
        own_model = load_spec(own_path).compile()
        expected, actual = (in_default_pose(each, description) for each in (own_model, model))
        for foot, geoms in zip(feet, found, strict=True):
            for index in np.flatnonzero(geoms < 0):
                own_geom = own_model.geom(foot.geoms[index]).id
                expected_centre = _from_last_joint(own_model, expected, foot, own_geom)
                geoms[index] = _nearest(model, actual, foot, expected_centre)
    return tuple(_unique(geoms[geoms >= 0]) for geoms in found)


def _unique(geoms: np.ndarray) -> np.ndarray:
    """The ids in their order, without repetitions."""
    return np.array(list(dict.fromkeys(geoms.tolist())), dtype=int)


def _from_last_joint(model: mujoco.MjModel, data: mujoco.MjData, foot: Foot, geom: int) -> np.ndarray:
    """Position of a geom's centre relative to the anchor of the leg's last joint, m, (3,)."""
    return data.geom_xpos[geom] - data.xanchor[model.joint(foot.joints[-1]).id]


def _nearest(model: mujoco.MjModel, data: mujoco.MjData, foot: Foot, expected_centre: np.ndarray) -> int:
    """The geom of the leg's last link nearest to a position, -1 if none is near.

    Distance is measured to the geom's centre. For a foot of several geoms it is also measured to the contact
    points, since one box may replace all four corners. Among equals the nearest centre wins.
    """
    link = model.body_weldid[model.joint(foot.joints[-1]).bodyid[0]]
    collides = (model.geom_contype | model.geom_conaffinity) != 0
    candidates = np.flatnonzero(collides & (model.body_weldid[model.geom_bodyid] == link)).tolist()
    if not candidates:
        return -1
    joint = data.xanchor[model.joint(foot.joints[-1]).id]
    centre = np.array([np.linalg.norm(data.geom_xpos[geom] - joint - expected_centre) for geom in candidates])
    distance = centre
    if len(foot.geoms) > 1:
        touching = (_world_spheres(model, data, geom) - joint - expected_centre for geom in candidates)
        distance = np.minimum(centre, [np.linalg.norm(each, axis=1).min() for each in touching])
    nearest = int(np.lexsort((centre, distance.round(6)))[0])
    return candidates[nearest] if distance[nearest] <= MAX_OFFSET * np.linalg.norm(expected_centre) else -1


def _world_spheres(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """Centres of a geom's contact spheres, m, (k, 3), world frame."""
    body = model.geom_bodyid[geom]
    spheres = foot_spheres(model, np.array([geom]), np.zeros(3))
    return data.xpos[body] + spheres.centre @ data.xmat[body].reshape(3, 3).T
