"""Kinematics of a robot's limbs: tip positions and velocities, and the joint angles for tip positions.

Forward kinematics is MuJoCo's (`forward.py`). Inverse kinematics is in closed form for limbs that have one
(`closed_form.py`), and by damped least squares on MuJoCo's Jacobians for all others (`least_squares.py`).
Limbs of one robot may have different numbers of hinges: arrays are as wide as the longest limb, m, and zero
for missing hinges.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from footfall.common.linear import solve
from footfall.common.rotations import skew
from footfall.robots.feet import FootSpheres, foot_geoms, foot_spheres
from footfall.robots.forward import ForwardKinematics, LegPose
from footfall.robots.inverse import InverseKinematics
from footfall.robots.limb_order import LimbOrder
from footfall.robots.robot_yaml import Description
from footfall.robots.stance import base_corners, lowest_points

_REGULARISATION = 1e-6 * np.eye(3)  # m^2/rad^2


class Legs:
    """Kinematics of all limbs together. Their order is that of the feet in `robot.yaml`.

    The object owns the arrays in which a pose is computed: it is not thread-safe.

    Args:
        description: description of the robot.
        xml_path: the robot's own MJCF: only the nominal geometry is used, never a plant's.

    Raises:
        UserError: a limb has joints other than hinges.
    """

    def __init__(self, description: Description, xml_path: Path) -> None:
        self._order = order = LimbOrder(description)
        self.count, self.hinges = order.count, order.hinges
        # (legs, m) joint indices, and whether each hinge exists.
        self.joints, self.present = order.joints, order.present
        self._forward = ForwardKinematics(description, xml_path, order)
        model, default = self._forward.model, description.default_pose
        self.mass = float(model.body_subtreemass[model.body(description.base).id])  # kg, of the whole robot
        self.limbs = self._forward.limbs(default)
        self.reach = np.array([limb.reach for limb in self.limbs])  # (legs,) m, from each first hinge
        self.spheres: list[FootSpheres] = [  # contact spheres of each foot
            foot_spheres(model, geoms, model.site_pos[tip])
            for geoms, tip in zip(foot_geoms(model, description), self._forward.tips, strict=True)
        ]
        self._last_rolling = np.empty(0), b"", np.empty(0)
        self._last_pose = default.tobytes(), self._forward.pose(default)
        self.default_angles = self.gather(default)
        self.default_foot = self.pose(default).foot
        self.foot_radius = self.default_foot[:, 2] - lowest_points(description, model)
        self.base_corners = base_corners(description, model)
        self.base_below = -float(self.base_corners[:, 2].min())  # m, depth of a level base below its origin
        # Repeated to the size of a limb's Jacobian: broadcasting would take longer.
        self._radii = np.repeat(self.foot_radius, 3 * self.hinges).reshape(self.count, 3, self.hinges)
        self.inverse = InverseKinematics(description, self.limbs, self.default_foot, order, self._forward)

    def pose(self, joint_position: np.ndarray) -> LegPose:
        """Feet, Jacobians and joint axes; the arrays must not be written to.

        The last result is cached: in each tick the estimator and a controller use the same readings.

        Args:
            joint_position: (n,) rad, in the robot's joint order.
        """
        key = joint_position.tobytes()
        if key != self._last_pose[0]:
            self._last_pose = key, self._forward.pose(joint_position)
        return self._last_pose[1]

    def tip_rotation(self, joint_position: np.ndarray) -> np.ndarray:
        """Rotation of each limb's last link, to the base frame, (legs, 3, 3)."""
        self.pose(joint_position)
        return self._forward.tip_rotation()

    def holding_torque(self, joint_position: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Torques (legs, m), N m, that hold the limbs against their own weight and the base's acceleration.

        Args:
            joint_position: (n,) rad.
            acceleration: (3,) m/s^2, the base's proper acceleration, base frame: 9.81 upwards at rest.
        """
        self.pose(joint_position)
        return self._forward.holding_torque(acceleration)

    def solve(self, foot: np.ndarray, legs: Sequence[int] | None = None) -> np.ndarray:
        """Joint angles for given tip positions; the inverse of `pose`.

        Every result is finite and within the joint limits. For a position out of reach, the limb points at
        it, stretched or folded as far as the limits allow. For NaN the angles are NaN. Of several solutions,
        the result is the one on the default pose's side.

        Args:
            foot: (k, 3) m, base frame.
            legs: indices of the k limbs; None: all.

        Returns:
            (k, m) rad.
        """
        return self.inverse.solve(foot, legs)

    def rolling_offset(self, axes: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Difference of the Jacobians of the feet's lowest points and of the tips.

        A round foot rolls: in stance its lowest point is at rest, not its centre. At walking speed the
        difference is close to a tenth of the base's speed. The same holds for a sole flat on the ground.
        The last result is cached, as for `pose`, and must not be written to.

        Args:
            axes: (legs, 3, m) from `pose`.
            up: (3,) the ground's normal in the base frame.

        Returns:
            (legs, 3, m) m/rad.
        """
        key = up.tobytes()
        if axes is not self._last_rolling[0] or key != self._last_rolling[1]:
            self._last_rolling = axes, key, self._radii * (skew(up) @ axes)
        return self._last_rolling[2]

    def torque(self, jacobian: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Joint torques (legs, m), N m, at which the ground exerts forces (legs, 3), N, on limbs at rest.

        Args:
            jacobian: (legs, 3, m) of the points that the forces act on.
            force: base frame.
        """
        return -(force[:, None, :] @ jacobian)[:, 0]

    def joint_rates(self, jacobian: np.ndarray, motion: np.ndarray) -> np.ndarray:
        """Joint rates (legs, m, k) for k motions of the tips, (legs, 3, k), or the nearest possible ones.

        If all limbs have three hinges, the rates are exact. Otherwise they are the smallest ones, damped near
        singular poses.

        Args:
            jacobian: (legs, 3, m).
            motion: m/s, m/s^2 or another derivative; the result has the same one.
        """
        if self.hinges == 3 and self._order.uniform:
            return solve(jacobian, motion)
        transposed = jacobian.transpose(0, 2, 1)
        return transposed @ solve(jacobian @ transposed + _REGULARISATION, motion)

    def gather(self, joint_values: np.ndarray) -> np.ndarray:
        """Joint order (..., n) to limbs (..., legs, m)."""
        return self._order.gather(joint_values)

    def scatter(self, leg_values: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Limbs (..., legs, m) to joint order (..., n); joints outside them keep their value in `others`."""
        return self._order.scatter(leg_values, others)
