"""A summary of a robot's description: its tree, its feet in the default pose, the reach of its legs."""

from collections.abc import Iterator
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.robots.description import Robot
from footfall.robots.feet import foot_geoms
from footfall.robots.model import joint_addresses, plant_model
from footfall.robots.support import support_margin

WORLD = 0
LIFTED_M = 0.005  # a foot above this height does not touch the ground
POSES = 2000  # random poses to estimate the reach of the legs


class LinkRow(NamedTuple):
    """One moving link of the tree."""

    depth: int  # 0 for the base
    name: str
    mass_kg: float
    joints: tuple[str, ...]


class FootRow(NamedTuple):
    """One foot in the default pose."""

    name: str
    position: np.ndarray  # (3,) m, base frame, middle of its geoms
    gap_m: float  # between its lowest point and the ground, which the lowest foot touches
    reach_m: tuple[float, float]  # smallest and largest distance from its leg's first joint


class Inspection(NamedTuple):
    """A robot in its default pose, the base level, the lowest foot on the ground."""

    links: tuple[LinkRow, ...]
    mass_kg: float
    centre_m: np.ndarray  # (3,) of mass, base frame
    feet: tuple[FootRow, ...]
    margin_m: float  # of the centre of mass within the feet, see `support_margin`
    on_the_ground: tuple[str, ...]  # links that touch the ground, except feet
    touching: tuple[tuple[str, str], ...]  # pairs of links that collide

    def findings(self, stands_still: bool = True) -> Iterator[str]:
        """Problems of the robot, one line each; `stands_still`: whether it can stand still."""
        for foot in self.feet:
            if foot.gap_m > LIFTED_M:
                yield f"foot {foot.name} is {1e3 * foot.gap_m:.0f} mm above the ground in the default pose"
        for link in self.on_the_ground:
            yield f"link {link} touches the ground in the default pose, but is not a foot"
        for one, other in self.touching:
            yield f"links {one} and {other} collide in the default pose"
        if stands_still and self.margin_m <= 0.0:
            yield "the centre of mass is not above the area between the feet in the default pose"


def inspect_robot(robot: Robot, seed: int = 0) -> Inspection:
    """Inspect a robot.

    Args:
        robot: the robot.
        seed: seed of the random poses that estimate the reach.
    """
    model = plant_model(robot)
    data = _standing(model, robot)
    feet = foot_geoms(model, robot.description)
    base = model.body(robot.description.base).id
    low = [min(_height(model, data, geom) for geom in geoms) for geoms in feet]
    middle = [data.geom_xpos[geoms].mean(axis=0) for geoms in feet]
    bodies = [int(model.geom_bodyid[geoms[0]]) for geoms in feet]
    reach = _reach(model, robot, feet, np.random.default_rng(seed))
    rows = tuple(
        FootRow(foot.name, middle[i] - data.xpos[base], low[i] - min(low), reach[i])
        for i, foot in enumerate(robot.description.feet)
    )
    corners = [(float(x), float(y)) for geoms in feet for x, y, _ in data.geom_xpos[geoms]]
    centre = data.subtree_com[base]
    pairs = {tuple(sorted(model.geom_bodyid[list(pair)].tolist())) for pair in _touching(data)}
    on_ground = {b for a, b in pairs if a == WORLD} - set(bodies)
    return Inspection(
        links=tuple(_tree(model, base)),
        mass_kg=float(model.body_subtreemass[base]),
        centre_m=centre - data.xpos[base],
        feet=rows,
        margin_m=support_margin(corners, (float(centre[0]), float(centre[1]))),
        on_the_ground=tuple(model.body(b).name for b in sorted(on_ground)),
        touching=tuple((model.body(a).name, model.body(b).name) for a, b in sorted(pairs) if a != WORLD),
    )


def _standing(model: mujoco.MjModel, robot: Robot) -> mujoco.MjData:
    data = mujoco.MjData(model)
    free = int(np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)[0])
    at = model.jnt_qposadr[free]
    data.qpos[at : at + 7] = (0.0, 0.0, robot.description.standing_height_m, 1.0, 0.0, 0.0, 0.0)
    data.qpos[joint_addresses(model, robot)[0]] = robot.default_pose
    mujoco.mj_forward(model, data)
    return data


def _touching(data: mujoco.MjData) -> list[tuple[int, int]]:
    """Geoms that touch or overlap, in pairs."""
    geoms, distance = data.contact.geom, data.contact.dist
    return [(int(a), int(b)) for (a, b), gap in zip(geoms, distance, strict=True) if gap <= 0.0]


def _height(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> float:
    """Height of a geom's lowest point above the plane z = 0, m."""
    floor = int(np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)[0])
    return float(mujoco.mj_geomDistance(model, data, floor, geom, 10.0, None))


def _tree(model: mujoco.MjModel, base: int) -> Iterator[LinkRow]:
    depth = {base: 0}
    for body in range(base, model.nbody):
        parent = int(model.body_parentid[body])
        if body != base and parent not in depth:
            continue
        depth[body] = 0 if body == base else depth[parent] + 1
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        joints = () if body == base else tuple(model.joint(j).name for j in range(first, first + count))
        yield LinkRow(depth[body], model.body(body).name, float(model.body_mass[body]), joints)


def _reach(
    model: mujoco.MjModel, robot: Robot, feet: tuple[np.ndarray, ...], random: np.random.Generator
) -> list[tuple[float, float]]:
    """Smallest and largest distance of each foot from its leg's first joint, m, over random poses."""
    data = _standing(model, robot)
    addresses = joint_addresses(model, robot)[0]
    first = [model.joint(foot.joints[0]).id for foot in robot.description.feet]
    distance = np.empty((POSES, len(feet)))
    for pose in range(POSES):
        data.qpos[addresses] = random.uniform(robot.lower_rad, robot.upper_rad)
        mujoco.mj_kinematics(model, data)
        distance[pose] = [
            np.linalg.norm(data.geom_xpos[geoms].mean(axis=0) - data.xanchor[joint])
            for geoms, joint in zip(feet, first, strict=True)
        ]
    nearest, farthest = distance.min(axis=0).tolist(), distance.max(axis=0).tolist()
    return list(zip(nearest, farthest, strict=True))
