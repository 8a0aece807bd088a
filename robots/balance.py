"""A robot's balance: centre of mass, capture point, support polygon, ground forces."""

import math
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.common.linear import solve
from footfall.common.rotations import rotation_matrix
from footfall.robots.description import Robot
from footfall.robots.feet import foot_geoms, foot_spheres
from footfall.robots.mjcf import load_spec
from footfall.robots.model import joint_addresses
from footfall.robots.momentum import external_torque
from footfall.robots.readings import Sensed
from footfall.robots.support import convex_hull

CONTACT_THRESHOLD = 0.5  # contact probability above which a foot carries weight
_REGULARISATION = 1e-5 * np.eye(3)  # m^2/rad^2
_MIN_HEIGHT_M = 0.01  # smallest height of the inverted pendulum


class Balance(NamedTuple):
    """Points and forces in the frame of the given pose, m and N."""

    centre: np.ndarray  # (3,) centre of mass
    capture: np.ndarray  # (3,) capture point, on the ground
    foot: np.ndarray  # (feet, 3) lowest point of each foot
    support: np.ndarray  # (k, 3) corners of the support polygon, counter-clockwise; empty if no foot stands
    force: np.ndarray  # (feet, 3) N, of the ground on each foot that stands; zero for the other feet


class BalanceModel:
    """Computes the balance with the robot's own model, not with a plant's. For one thread at a time.

    Forces explain the motors' torques under the assumption that legs do not accelerate: see `momentum.py`.
    The capture point is that of an inverted pendulum as high as the centre of mass (Pratt et al. 2006).
    """

    def __init__(self, robot: Robot) -> None:
        description = robot.description
        model = self._model = load_spec(robot.xml_path).compile()
        self._data, self._legs = mujoco.MjData(model), robot.legs
        self._joint_qpos, self._joint_qvel = joint_addresses(model, robot)
        base = model.body(description.base)
        self._base = int(base.id)
        self._qpos, self._qvel = int(model.jnt_qposadr[base.jntadr[0]]), int(model.jnt_dofadr[base.jntadr[0]])
        geoms = foot_geoms(model, description)
        self._feet = [int(model.geom_bodyid[each[0]]) for each in geoms]
        self._spheres = [foot_spheres(model, each, np.zeros(3)) for each in geoms]

    def at(
        self, position: np.ndarray, quaternion: np.ndarray, velocity: np.ndarray, sensed: Sensed,
        contact: np.ndarray,
    ) -> Balance:  # fmt: skip
        """The balance of a robot in a given state.

        Args:
            position: (3,) m, of the base's origin.
            quaternion: (4,) w x y z, body to the frame of the position.
            velocity: (3,) m/s, of the base's origin, body frame.
            sensed: joints and IMU. Its quaternion is not used.
            contact: (feet,) probability that each foot stands.
        """
        model, data = self._model, self._data
        rotation = rotation_matrix(quaternion)
        data.qpos[self._qpos : self._qpos + 3] = position
        data.qpos[self._qpos + 3 : self._qpos + 7] = quaternion
        data.qpos[self._joint_qpos] = sensed.joint_position
        data.qvel[self._qvel : self._qvel + 3] = rotation @ velocity
        data.qvel[self._qvel + 3 : self._qvel + 6] = sensed.gyro
        data.qvel[self._joint_qvel] = sensed.joint_velocity
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        mujoco.mj_subtreeVel(model, data)

        points = [self._lowest(foot) for foot in range(len(self._feet))]
        foot = np.array([each[each[:, 2].argmin()] for each in points])
        stands = contact > CONTACT_THRESHOLD
        ground_z = float(foot[stands, 2].mean()) if stands.any() else float(foot[:, 2].min())
        centre = data.subtree_com[self._base].copy()
        fall_s = math.sqrt(max(centre[2] - ground_z, _MIN_HEIGHT_M) / GRAVITY_M_S2)
        capture = centre + fall_s * data.subtree_linvel[self._base]
        capture[2] = ground_z
        corners = convex_hull(
            [(float(x), float(y)) for foot in np.flatnonzero(stands) for x, y, _ in points[foot]]
        )
        support = np.array([(x, y, ground_z) for x, y in corners]).reshape(-1, 3)
        return Balance(centre, capture, foot, support, self._forces(sensed, stands) @ rotation.T)

    def _lowest(self, foot: int) -> np.ndarray:
        """The lowest point of each sphere of a foot, (k, 3) m."""
        centre, radius = self._spheres[foot]
        body = self._feet[foot]
        points = self._data.xpos[body] + centre @ self._data.xmat[body].reshape(3, 3).T
        points[:, 2] -= radius
        return points

    def _forces(self, sensed: Sensed, stands: np.ndarray) -> np.ndarray:
        """Forces on the feet, (feet, 3) N, base frame."""
        torque = external_torque(self._legs, sensed, sensed.joint_torque)
        jacobian = self._legs.pose(sensed.joint_position).jacobian
        regularised = jacobian @ jacobian.transpose(0, 2, 1) + _REGULARISATION
        force: np.ndarray = solve(regularised, jacobian @ torque[:, :, None])[:, :, 0]
        return force * stands[:, None]
