"""Equations of motion of a robot and the Jacobians of its feet, by MuJoCo.

World axes, with the origin at that of the base. Degrees of freedom: the base first (linear velocity in the
world, angular velocity in the body), then the joints in the robot's order.
"""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.arrays import as_slice
from footfall.common.constants import GRAVITY_M_S2
from footfall.common.errors import UserError
from footfall.common.rotations import skews
from footfall.robots.description import Robot
from footfall.robots.feet import foot_geoms
from footfall.robots.mjcf import load_spec

BASE = 6  # degrees of freedom of the base
DOWN = np.array([0.0, 0.0, -1.0])
FREE_FALL = np.array([0.0, 0.0, -GRAVITY_M_S2])
_ONES = np.ones((3, 1))


class Motion(NamedTuple):
    """Orientation, velocity and joint state of the robot."""

    quaternion: np.ndarray  # (4,) w x y z, body to world
    velocity: np.ndarray  # (3,) m/s, velocity of the base's origin, world
    gyro: np.ndarray  # (3,) rad/s, body frame
    joint_position: np.ndarray  # (n,) rad
    joint_velocity: np.ndarray  # (n,) rad/s


class Dynamics(NamedTuple):
    """Terms of mass @ acceleration + bias = torques + jacobian.T @ forces, and positions.

    A drift is the acceleration of a point or foot if no degree of freedom accelerates.
    """

    velocity: np.ndarray  # (nv,) m/s and rad/s
    mass: np.ndarray  # (nv, nv), reflected inertia included
    bias: np.ndarray  # (nv,) N and N m: gravity, Coriolis and centrifugal forces
    centre: np.ndarray  # (3,) m, centre of mass relative to the base's origin
    centre_velocity: np.ndarray  # (3,) m/s
    angular_momentum: np.ndarray  # (3,) kg m^2/s, about the centre of mass
    point: np.ndarray  # (points, 3) m, contact points: the lowest point of each contact geom
    point_jacobian: np.ndarray  # (points, 3, nv)
    point_drift: np.ndarray  # (points, 3) m/s^2
    foot: np.ndarray  # (feet, 3) m, middle of each foot's points
    feet_middle: np.ndarray  # (3,) m, mean position of the feet
    foot_rotation: np.ndarray  # (feet, 3, 3) to the world; identity for a level robot in its default pose
    foot_jacobian: np.ndarray  # (feet, 6, nv), linear above angular
    foot_drift: np.ndarray  # (feet, 6) m/s^2 and rad/s^2
    gravity: np.ndarray  # (3,) m/s^2


class Soles:
    """Contact points of the feet: constants of a model."""

    def __init__(self, model: mujoco.MjModel, geoms: Sequence[np.ndarray]) -> None:
        """`geoms`: ids of each foot's contact geoms, (k,) each."""
        self.geoms = np.concatenate(geoms)
        self.foot_of_point = np.repeat(np.arange(len(geoms)), [len(each) for each in geoms])
        self.bodies = [int(model.geom_bodyid[each[0]]) for each in geoms]  # body of each foot
        self._to_lowest_point = model.geom_size[self.geoms, 0][:, None] * DOWN
        is_of_foot = np.zeros((len(geoms), len(self.geoms)))
        is_of_foot[self.foot_of_point, np.arange(len(self.geoms))] = 1.0
        self._middle = is_of_foot / is_of_foot.sum(axis=1, keepdims=True)

    def positions(self, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
        """Positions of the points, (points, 3) m, and the middle of each foot's points, (feet, 3) m."""
        points = data.geom_xpos.take(self.geoms, axis=0) + self._to_lowest_point
        return points, self._middle.dot(points)


class _Buffers(NamedTuple):
    """Arrays to which MuJoCo writes its results."""

    mass: np.ndarray  # (nv, nv)
    bias: np.ndarray  # (nv,)
    jacobian: np.ndarray  # (feet, 6, nv)
    jacobian_rate: np.ndarray  # (feet, 6, nv)


class WholeBody:
    """Dynamics of the robot's nominal model; the plant's true masses are not used.

    The arrays to which MuJoCo writes belong to this object: use it in one thread at a time.

    Attributes:
        foot_of_point: (points,) foot of each contact point.
        total_mass: kg.
        weight_n: N.

    Raises:
        UserError: the robot has a joint that `robot.yaml` does not list.
    """

    def __init__(self, robot: Robot) -> None:
        model = self._model = load_spec(robot.xml_path).compile()
        data = self._data = mujoco.MjData(model)
        n = len(robot.joint_names)
        if model.nv != BASE + n:
            raise UserError(
                f"{robot.xml_path}: whole-body control needs a free base and exactly the joints of robot.yaml"
            )
        base = model.body(robot.description.base)
        position_start = int(model.jnt_qposadr[base.jntadr[0]])
        velocity_start = int(model.jnt_dofadr[base.jntadr[0]])
        base_order = np.arange(velocity_start, velocity_start + BASE)
        joints = [model.joint(name).id for name in robot.joint_names]
        self._base = int(base.id)
        self._quaternion = slice(position_start + 3, position_start + 7)
        self._positions = as_slice(model.jnt_qposadr[joints])
        self._order = as_slice(np.concatenate([base_order, model.jnt_dofadr[joints]]))
        self._soles = soles = Soles(model, foot_geoms(model, robot.description))
        self.foot_of_point, self.points, self.feet = soles.foot_of_point, len(soles.geoms), len(soles.bodies)
        self.total_mass = float(model.body_mass.sum())
        self.weight_n = self.total_mass * float(-model.opt.gravity[2])
        nv = model.nv
        self._buffers = _Buffers(
            np.zeros((nv, nv)), np.zeros(nv), np.zeros((self.feet, 6, nv)), np.zeros((self.feet, 6, nv))
        )
        data.qpos[:] = 0.0
        data.qpos[position_start + 3] = 1.0
        data.qpos[self._positions] = robot.default_pose
        mujoco.mj_kinematics(model, data)
        self._level_inverse = data.xmat[soles.bodies].reshape(-1, 3, 3).transpose(0, 2, 1).copy()

    def update(self, motion: Motion, gravity: np.ndarray = FREE_FALL) -> Dynamics:
        """Dynamics in a state of motion. The world may be a frame with tilted gravity."""
        model, data, order, soles, buffers = self._model, self._data, self._order, self._soles, self._buffers
        model.opt.gravity[:] = gravity
        data.qpos[self._quaternion] = motion.quaternion
        data.qpos[self._positions] = motion.joint_position
        velocity = np.concatenate([motion.velocity, motion.gyro, motion.joint_velocity])
        data.qvel[order] = velocity
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_makeM(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)
        mujoco.mj_rne(model, data, 0, buffers.bias)
        mujoco.mj_fullM(model, data, buffers.mass)

        points, foot = soles.positions(data)
        for position, body, rows, rates in zip(
            foot, soles.bodies, buffers.jacobian, buffers.jacobian_rate, strict=True
        ):
            mujoco.mj_jac(model, data, rows[:3], rows[3:], position, body)
            mujoco.mj_jacDot(model, data, rates[:3], rates[3:], position, body)
        jacobian = buffers.jacobian[:, :, order].copy()
        drift = buffers.jacobian_rate[:, :, order].dot(velocity)
        spin = jacobian[:, 3:].dot(velocity)
        foot_of_point = soles.foot_of_point
        arm = points - foot[foot_of_point]
        cross_arm = -skews(arm)
        return Dynamics(
            velocity,
            buffers.mass[order][:, order].copy(),
            buffers.bias[order].copy(),
            data.subtree_com[self._base].copy(),
            data.subtree_linvel[self._base].copy(),
            data.subtree_angmom[self._base].copy(),
            points,
            jacobian[foot_of_point, :3] + cross_arm @ jacobian[foot_of_point, 3:],
            drift[foot_of_point, :3]
            + (cross_arm @ drift[foot_of_point, 3:, None])[:, :, 0]
            + _centripetal(spin[foot_of_point], arm),
            foot,
            np.full(self.feet, 1.0 / self.feet).dot(foot),
            data.xmat[soles.bodies].reshape(-1, 3, 3) @ self._level_inverse,
            jacobian,
            drift,
            gravity,
        )


def _centripetal(spin: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """spin x (spin x arm), each (k, 3)."""
    return spin * (spin * arm).dot(_ONES) - arm * (spin * spin).dot(_ONES)
