"""Statics of a robot on stiff joints: its torques, and whether it tips.

With its feet fixed to the ground, a robot at rest in its default pose is stable if its potential energy (of
gravity and of the joints' springs) has a minimum there: N'(K + G)N is positive definite. N is a basis of the
motions that do not move the feet, K has the joints' stiffnesses, and G is the slope of gravity's generalised
force at constant ground forces.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.robots.importer.machine import Leg

STEP = 1e-5  # rad and m, of the central differences


class Statics(NamedTuple):
    """Statics at rest in the default pose, with the feet on the ground."""

    torque_nm: np.ndarray  # (n,) of the joints, in joint order
    gravity: np.ndarray  # (k, k) N' G N
    joints: np.ndarray  # (n, k) the joints' part of the motions N

    def stable(self, kp: np.ndarray) -> bool:
        """Whether joints of stiffness kp (n,), N m/rad, prevent tipping."""
        stiffness = self.joints.T @ (kp[:, None] * self.joints) + self.gravity
        values = np.linalg.eigvalsh(stiffness)
        return bool(len(values) == 0 or values[0] > 1e-6 * max(values[-1], 1.0))


def statics(
    model: mujoco.MjModel, joints: tuple[str, ...], legs: tuple[Leg, ...], qpos: np.ndarray
) -> Statics:
    """Torques and stability of a model that stands with pose `qpos`, its feet touching the ground.

    Args:
        model: model with a free base as its first joint.
        joints: names of the driven joints.
        legs: the legs; their geoms, spheres and ellipsoids, stand on the ground.
        qpos: (nq,) configuration with a level base.
    """
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    points = [_lowest_point(model, data, name) for leg in legs for name in leg.geoms]
    positions = np.array([position for _, position in points])
    force = _ground_forces(positions, data.subtree_com[1], float(model.body_mass.sum() * GRAVITY_M_S2))
    body_points = [
        (body, data.xmat[body].reshape(3, 3).T @ (position - data.xpos[body])) for body, position in points
    ]
    required = _required_force(model, qpos, body_points, force)
    jacobian = np.concatenate([_jacobian(model, data, body, local) for body, local in body_points])
    _, values, rows = np.linalg.svd(jacobian)
    free = rows[int((values > 1e-6 * values[0]).sum()) :].T
    slope = np.stack([_slope(model, qpos, body_points, force, direction) for direction in free.T], axis=1)
    gravity = free.T @ slope
    dofs = [int(model.joint(name).dofadr[0]) for name in joints]
    return Statics(required[dofs], (gravity + gravity.T) / 2, free[dofs])


def _lowest_point(model: mujoco.MjModel, data: mujoco.MjData, geom: str) -> tuple[int, np.ndarray]:
    """Id of a geom's body, and the geom's lowest point, (3,) m. The geom is a sphere or an ellipsoid."""
    index = model.geom(geom).id
    axes, size = data.geom_xmat[index].reshape(3, 3), model.geom_size[index]
    if model.geom_type[index] == mujoco.mjtGeom.mjGEOM_SPHERE:
        size = np.full(3, size[0])
    below = axes @ (size**2 * axes[2] / np.linalg.norm(size * axes[2]))
    return int(model.geom_bodyid[index]), data.geom_xpos[index] - below


def _ground_forces(positions: np.ndarray, centre: np.ndarray, weight_n: float) -> np.ndarray:
    """Upward forces at points (k, 3) that carry the weight and balance about the centre of mass, N, (k,)."""
    rows = np.stack([np.ones(len(positions)), positions[:, 0] - centre[0], positions[:, 1] - centre[1]])
    return np.linalg.pinv(rows, rcond=1e-6) @ np.array([weight_n, 0.0, 0.0])


def _jacobian(model: mujoco.MjModel, data: mujoco.MjData, body: int, local: np.ndarray) -> np.ndarray:
    """Jacobian (3, nv) of a point of a body; `local` (3,), m, is the point in the body's frame."""
    jacobian = np.zeros((3, model.nv))
    position = data.xpos[body] + data.xmat[body].reshape(3, 3) @ local
    mujoco.mj_jac(model, data, jacobian, None, position, body)
    return jacobian


def _required_force(
    model: mujoco.MjModel, qpos: np.ndarray, body_points: list[tuple[int, np.ndarray]], force: np.ndarray
) -> np.ndarray:
    """Generalised force required for equilibrium, (nv,): against gravity, minus the ground's forces."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    required = data.qfrc_bias.copy()
    for (body, local), upward in zip(body_points, force, strict=True):
        required -= upward * _jacobian(model, data, body, local)[2]
    return required


def _slope(
    model: mujoco.MjModel,
    qpos: np.ndarray,
    body_points: list[tuple[int, np.ndarray]],
    force: np.ndarray,
    direction: np.ndarray,
) -> np.ndarray:
    """Derivative of `_required_force` along a direction (nv,)."""
    plus, minus = qpos.copy(), qpos.copy()
    mujoco.mj_integratePos(model, plus, direction, STEP)
    mujoco.mj_integratePos(model, minus, direction, -STEP)
    difference = _required_force(model, plus, body_points, force) - _required_force(
        model, minus, body_points, force
    )
    return difference / (2 * STEP)
