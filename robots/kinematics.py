"""Legs of three hinges: forward kinematics, Jacobians and closed-form inverse kinematics.

A leg is read from the robot's MJCF as a first hinge followed by two parallel ones (abduction, hip, knee of
a quadruped; coxa, femur, tibia of a hexapod). Seen from the first link, such a leg is a two-link arm in
the plane across the parallel axes, so a complex number holds the foot's place in that plane:

    z = exp(i q2) (upper + exp(i q3) lower)

and the first hinge carries the plane around its axis. All legs are computed at once.
"""

from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.robots.description import Robot, load_spec

_PARALLEL = 1e-6  # largest sine of the angle between two axes that count as parallel


class LegPose(NamedTuple):
    """Where the legs are, in the base frame (origin at the base body's, axes along it)."""

    foot: np.ndarray  # (legs, 3) m, centre of each foot geom
    jacobian: np.ndarray  # (legs, 3, 3) m/rad, foot velocity = jacobian @ joint velocity
    axes: np.ndarray  # (legs, 3, 3), column j is the direction of the leg's joint j


class Legs:
    """Kinematics of a robot's legs. Leg order is that of the feet in `robot.yaml`.

    Args:
        robot: whose MJCF is read. Only the nominal geometry is used, never a plant's.

    Raises:
        UserError: a leg is not made of three hinges of which the last two are parallel.
    """

    def __init__(self, robot: Robot) -> None:
        self.joints = _leg_joints(robot)
        self.count = len(self.joints)
        anchor, axis, foot, self.foot_radius = _zero_pose(robot)
        lower, upper = robot.lower_rad[self.joints], robot.upper_rad[self.joints]
        self._middle, self._half = (upper + lower) / 2, (upper - lower) / 2
        self._set_plane(robot, anchor, axis, foot)
        self.default_angles = robot.default_pose[self.joints]
        self.default_foot = self.pose(robot.default_pose).foot
        self._choose_branches()

    def pose(self, joint_position: np.ndarray) -> LegPose:
        """Feet, Jacobians and joint axes.

        Args:
            joint_position: (n,) rad, in the robot's joint order.
        """
        turn = np.exp(1j * joint_position[self.joints])
        first, second, third = turn[:, 0], turn[:, 1], turn[:, 2]
        end = second * third * self._link_lower
        z = second * self._link_upper + end
        cos, sin = first.real[:, None, None], first.imag[:, None, None]
        carried = self._carry_along + cos * self._carry_across + sin * self._carry_turned
        swept = cos * self._carry_turned - sin * self._carry_across

        # Columns of `place`: the foot in the plane's coordinates (1, x, y), and its two derivatives there.
        place = np.zeros((self.count, 3, 3))
        place[:, 0, 0] = 1.0
        place[:, 1, 0], place[:, 2, 0] = z.real, z.imag
        place[:, 1, 1], place[:, 2, 1] = -z.imag, z.real
        place[:, 1, 2], place[:, 2, 2] = -end.imag, end.real
        jacobian = carried @ place
        foot = self._anchor + jacobian[:, :, 0]
        jacobian[:, :, 0] = (swept @ place)[:, :, 0]

        axes = np.empty((self.count, 3, 3))
        axes[:, :, 0] = self._axis
        axes[:, :, 1] = self._axes_along + cos[:, 0] * self._axes_across + sin[:, 0] * self._axes_turned
        axes[:, :, 2] = axes[:, :, 1]
        return LegPose(foot, jacobian, axes)

    def solve(self, foot: np.ndarray) -> np.ndarray:
        """Joint angles that put the feet at given places; the inverse of `pose`.

        Every result lies within the joint limits and is finite. A foot place out of reach gives the leg that
        points at it, stretched or folded as far as the limits allow. Of the two bends of a knee, and of the
        two sides of the first hinge, the default pose's are chosen.

        Args:
            foot: (legs, 3) m, base frame.

        Returns:
            (legs, 3) rad.
        """
        reach = foot - self._anchor
        # The first hinge must bring the reach's part along the parallel axes to its fixed value (Paden and
        # Kahan's fourth subproblem): across cos(q1) + turned sin(q1) = offset - along.
        along, across, turned = (self._axes_split @ reach[:, :, None])[:, :, 0].T
        cosine = (self._offset - along) / np.maximum(np.hypot(across, turned), 1e-9)
        angles = np.empty((self.count, 3))
        angles[:, 0] = np.arctan2(turned, across) + self._side * _arccos(cosine)
        first = self._within_limits(angles, 0)

        cos, sin = np.cos(first)[:, None, None], np.sin(first)[:, None, None]
        plane = self._carry_along + cos * self._carry_across + sin * self._carry_turned
        local = (reach[:, None, :] @ plane)[:, 0, 1:] - self._plane_origin
        z = local[:, 0] + 1j * local[:, 1]

        # Law of cosines for the knee, then the hip turns the whole two-link arm onto z.
        knee = (z.real**2 + z.imag**2 - self._square_sum) / self._twice_product
        angles[:, 2] = self._bend * _arccos(knee) - self._knee_offset
        third = self._within_limits(angles, 2)
        arm = self._link_upper + np.exp(1j * third) * self._link_lower
        angles[:, 1] = np.angle(z * arm.conj())
        self._within_limits(angles, 1)
        return angles

    def rolling_offset(self, axes: np.ndarray, up: np.ndarray) -> np.ndarray:
        """What to add to the foot centres' Jacobians to get those of the points that touch the ground.

        A round foot rolls: not its centre but its lowest point stands still in stance. At a walking pace the
        difference is close to a tenth of the base's speed.

        Args:
            axes: (legs, 3, 3) from `pose`.
            up: (3,) the ground's normal in the base frame.

        Returns:
            (legs, 3, 3) m/rad.
        """
        skew = np.array([[0.0, up[2], -up[1]], [-up[2], 0.0, up[0]], [up[1], -up[0], 0.0]])
        return -self.foot_radius[:, None, None] * (skew @ axes)

    def gather(self, joint_values: np.ndarray) -> np.ndarray:
        """Joint order (n,) to legs (legs, 3)."""
        return joint_values[self.joints]

    def scatter(self, leg_values: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Legs (legs, 3) to joint order (n,); joints outside the legs keep their value in `others`."""
        result = others.copy()
        result[self.joints] = leg_values
        return result

    def _within_limits(self, angles: np.ndarray, joint: int) -> np.ndarray:
        """Move one column of angles, in place, to the turn nearest its range's middle and into the range."""
        turn = angles[:, joint] - self._middle[:, joint]
        turn -= 2 * np.pi * np.rint(turn / (2 * np.pi))
        turn = np.minimum(np.maximum(turn, -self._half[:, joint]), self._half[:, joint])
        angles[:, joint] = self._middle[:, joint] + turn
        return angles[:, joint]

    def _set_plane(self, robot: Robot, anchor: np.ndarray, axis: np.ndarray, foot: np.ndarray) -> None:
        """Precompute what `pose` needs, from the zero pose: (legs, 3, 3) anchors and axes, feet."""
        normal = axis[:, 1]
        bend = np.linalg.norm(np.cross(normal, axis[:, 2]), axis=1)
        if np.any(bend > _PARALLEL) or np.any(np.sum(normal * axis[:, 2], axis=1) < 0):
            raise UserError(
                f"{robot.xml_path}: the second and third joint of each leg must have the same axis"
            )
        upper = anchor[:, 2] - anchor[:, 1]
        lower = foot - anchor[:, 2]
        upper_flat = upper - _along(upper, normal)
        x = upper_flat / np.linalg.norm(upper_flat, axis=1, keepdims=True)
        y = np.cross(normal, x)
        self._link_upper = _in_plane(upper, x, y)
        self._link_lower = _in_plane(lower, x, y)
        if np.any(np.abs(self._link_upper) < 1e-3) or np.any(np.abs(self._link_lower) < 1e-3):
            raise UserError(f"{robot.xml_path}: a leg has a link shorter than a millimetre")

        self._anchor, self._axis = anchor[:, 0], axis[:, 0]
        hip = anchor[:, 1] - anchor[:, 0] + _along(upper + lower, normal)
        self._offset = np.sum(hip * normal, axis=1)
        self._plane_origin = np.stack([np.sum(hip * x, axis=1), np.sum(hip * y, axis=1)], axis=1)
        flat = np.stack([hip, x, y], axis=2)  # plane coordinates (1, x, y) to the first link
        split = _split_rotation(self._axis)
        self._carry_along, self._carry_across, self._carry_turned = (part @ flat for part in split)
        self._axes_along, self._axes_across, self._axes_turned = (
            (part @ normal[:, :, None])[:, :, 0] for part in split
        )
        self._axes_split = np.stack([self._axes_along, self._axes_across, self._axes_turned], axis=1)
        if np.any(np.linalg.norm(self._axes_across, axis=1) < _PARALLEL):
            raise UserError(
                f"{robot.xml_path}: the first joint of each leg must not be parallel to the others"
            )

    def _choose_branches(self) -> None:
        """Knee bend and side of the first hinge, from the default pose."""
        upper, lower = self._link_upper, self._link_lower
        self._knee_offset = np.angle(lower / upper)
        self._square_sum = np.abs(upper) ** 2 + np.abs(lower) ** 2
        self._twice_product = 2 * np.abs(upper) * np.abs(lower)
        bent = self.default_angles[:, 2] + self._knee_offset
        self._bend = np.where(np.sin(bent) < 0, -1.0, 1.0)
        miss = []
        for side in (-1.0, 1.0):
            self._side = np.full(self.count, side)
            miss.append(np.abs(self.solve(self.default_foot) - self.default_angles).max(axis=1))
        self._side = np.where(miss[0] < miss[1], -1.0, 1.0)


def _arccos(cosine: np.ndarray) -> np.ndarray:
    return np.arccos(np.minimum(np.maximum(cosine, -1.0), 1.0))


def _along(vector: np.ndarray, axis: np.ndarray) -> np.ndarray:
    return np.sum(vector * axis, axis=1, keepdims=True) * axis


def _in_plane(vector: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.sum(vector * x, axis=1) + 1j * np.sum(vector * y, axis=1)


def _split_rotation(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rodrigues' rotation about each axis as along + cos(q) across + sin(q) turned, each (legs, 3, 3)."""
    along = axis[:, :, None] * axis[:, None, :]
    x, y, z = axis.T
    zero = np.zeros_like(x)
    turned = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    return along, np.eye(3) - along, turned


def _leg_joints(robot: Robot) -> np.ndarray:
    for foot in robot.description.feet:
        if len(foot.joints) != 3:
            raise UserError(
                f"{robot.folder / 'robot.yaml'}: foot {foot.name}: leg kinematics need 3 joints,"
                f" found {len(foot.joints)}"
            )
    return robot.foot_joints


def _zero_pose(robot: Robot) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Joint anchors and axes (legs, 3, 3), feet (legs, 3) in the base frame, and foot radii (legs,)."""
    model = load_spec(robot.xml_path).compile()
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    for joint in range(model.njnt):
        if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
            data.qpos[model.jnt_qposadr[joint] + 3] = 1.0
    mujoco.mj_kinematics(model, data)
    base = model.body(robot.description.base).id
    rotation, origin = data.xmat[base].reshape(3, 3), data.xpos[base]
    ids = np.array([model.joint(name).id for name in robot.joint_names])[robot.foot_joints]
    if np.any(model.jnt_type[ids] != mujoco.mjtJoint.mjJNT_HINGE):
        raise UserError(f"{robot.xml_path}: the joints of a leg must be hinges")
    geoms = [model.geom(foot.geom).id for foot in robot.description.feet]
    return (
        (data.xanchor[ids] - origin) @ rotation,
        data.xaxis[ids] @ rotation,
        (data.geom_xpos[geoms] - origin) @ rotation,
        model.geom_size[geoms, 0].copy(),
    )
