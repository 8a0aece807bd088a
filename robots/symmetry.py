"""Mirror images of a robot: the partner of each joint, foot and body."""

from typing import Any, NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.robots.description import Robot
from footfall.robots.feet import foot_geoms
from footfall.robots.model import training_model
from footfall.robots.stance import in_default_pose

Array = Any
POSITION_TOLERANCE_M = 0.01
HALF_CYCLE = 0.5
VECTOR = np.array([1.0, -1.0, 1.0])  # mirrors positions, velocities and forces at the x-z plane
ROTATION = np.array([-1.0, 1.0, -1.0])  # mirrors rotation vectors, angular velocities and torques


class Mirror(NamedTuple):
    """A mirror image of vectors: reorder, then change signs."""

    source: np.ndarray  # (n,) index of the component that each component comes from
    sign: np.ndarray  # (n,) 1.0 or -1.0

    def __call__(self, vector: Array) -> Array:
        """The mirror image of vectors of shape (..., n), NumPy or JAX."""
        xp = vector.__array_namespace__()
        return xp.take(vector, xp.asarray(self.source), axis=-1) * xp.asarray(self.sign, dtype=vector.dtype)


class Symmetry(NamedTuple):
    """A robot's mirror images."""

    joints: Mirror  # in joint order; signs of joint positions and torques
    feet: np.ndarray  # (feet,) each foot's partner
    bodies: np.ndarray  # (bodies,) each body's partner, without the world
    clock: float  # sign of the gait clock's sine and cosine


def find_symmetry(robot: Robot, phase: np.ndarray | None = None) -> Symmetry:
    """Pair the robot's parts by their positions in the default pose.

    A joint with axis a at position p is the mirror image of one at (p_x, -p_y, p_z) whose axis is parallel
    to (-a_x, a_y, -a_z): an axis is a rotation vector.

    Args:
        robot: the robot.
        phase: (feet,) phase of each foot in the gait of the clock; None without a gait.

    Raises:
        UserError: a part has no mirror image, or the default pose or the gait is not symmetric.
    """
    model = training_model(robot)
    data = in_default_pose(model, robot.description)
    ids = [model.joint(name).id for name in robot.joint_names]
    joints = _partners(data.xanchor[ids], robot, [f"joint {name}" for name in robot.joint_names])
    axes = data.xaxis[ids]
    along = np.sum(axes * ROTATION * axes[joints], axis=-1)
    names = robot.joint_names
    for name, partner, cosine in zip(names, joints, along, strict=True):
        if abs(cosine) < 0.99:
            raise UserError(f"robot '{robot.name}' is not symmetric: the axes of {name}, {names[partner]}")
    mirror = Mirror(joints, np.sign(along))
    if not np.allclose(mirror(robot.default_pose), robot.default_pose, atol=1e-3):
        raise UserError(f"robot '{robot.name}' is not symmetric: its default pose differs left and right")
    feet = np.array([data.geom_xpos[geoms].mean(axis=0) for geoms in foot_geoms(model, robot.description)])
    foot_names = [f"foot {foot.name}" for foot in robot.description.feet]
    bodies = [f"body {model.body(i).name}" for i in range(1, model.nbody)]
    foot_partners = _partners(feet, robot, foot_names)
    body_partners = _partners(data.xipos[1:], robot, bodies)
    return Symmetry(mirror, foot_partners, body_partners, _clock_sign(robot, foot_partners, phase))


def _clock_sign(robot: Robot, partners: np.ndarray, phase: np.ndarray | None) -> float:
    """Sign of the clock's sine and cosine in the mirror: -1 if partners step half a cycle apart."""
    if phase is None:
        return 1.0
    difference = (phase[partners] - phase) % 1.0
    if np.allclose(difference, HALF_CYCLE):
        return -1.0
    if np.allclose(difference, 0.0):
        return 1.0
    raise UserError(f"the gait of robot '{robot.name}' has no mirror image; turn ppo.symmetry off")


def _partners(positions: np.ndarray, robot: Robot, names: list[str]) -> np.ndarray:
    """For each position (k, 3), the index of the one at its mirror image."""
    distances = np.linalg.norm(positions[:, None] * VECTOR - positions[None], axis=-1)
    nearest = np.argmin(distances, axis=1)
    for name, distance in zip(names, distances.min(axis=1), strict=True):
        if distance > POSITION_TOLERANCE_M:
            raise UserError(f"robot '{robot.name}' is not symmetric: {name} has no mirror image")
    return nearest
