"""Legs of three hinges: forward kinematics, Jacobians and closed-form inverse kinematics.

The way forward is MuJoCo's. For the way back, a leg is read from the robot's MJCF as a first hinge followed
by two parallel ones (abduction, hip, knee of a quadruped; coxa, femur, tibia of a hexapod). Seen from the
first link, such a leg is a two-link arm in the plane across the parallel axes, so a complex number holds the
foot's place in that plane:

    z = exp(i q2) (upper + exp(i q3) lower)

and the first hinge carries the plane around its axis.
"""

import cmath
import math
from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from footfall.common.errors import UserError
from footfall.common.rotations import wrap_angle
from footfall.robots.description import Robot, load_spec

_PARALLEL = 1e-6  # largest sine of the angle between two axes that count as parallel


class LegPose(NamedTuple):
    """Where the legs are, in the base frame (origin at the base body's, axes along it)."""

    foot: np.ndarray  # (legs, 3) m, centre of each foot geom
    jacobian: np.ndarray  # (legs, 3, 3) m/rad, foot velocity = jacobian @ joint velocity
    axes: np.ndarray  # (legs, 3, 3), column j is the direction of the leg's joint j


class Legs:
    """Kinematics of a robot's legs. Leg order is that of the feet in `robot.yaml`.

    The arrays that a pose is worked out in belong to this object: it is for one thread at a time.

    Args:
        robot: whose MJCF is read. Only the nominal geometry is used, never a plant's.

    Raises:
        UserError: a leg is not made of three hinges of which the last two are parallel.
    """

    def __init__(self, robot: Robot) -> None:
        self.joints = _leg_joints(robot)
        self.count = len(self.joints)
        self._set_model(robot)
        self._set_plane(robot, *self._zero_pose())
        self._last = robot.default_pose.tobytes(), self._pose(robot.default_pose)
        self.default_angles = robot.default_pose[self.joints]
        self.default_foot = self.pose(robot.default_pose).foot
        self._choose_solutions(robot)

    def pose(self, joint_position: np.ndarray) -> LegPose:
        """Feet, Jacobians and joint axes; the arrays must not be written to.

        The last answer is kept: in each tick the estimator and a controller ask about the same readings.

        Args:
            joint_position: (n,) rad, in the robot's joint order.
        """
        key = joint_position.tobytes()
        if key != self._last[0]:
            self._last = key, self._pose(joint_position)
        return self._last[1]

    def _pose(self, joint_position: np.ndarray) -> LegPose:
        model, data = self._model, self._data
        data.qpos[self._addresses] = joint_position
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        foot = data.geom_xpos[self._geoms]
        for leg in range(self.count):
            mujoco.mj_jac(model, data, self._full_jacobian[leg], None, foot[leg], self._bodies[leg])
        return LegPose(
            foot, self._full_jacobian.take(self._jacobian_places), data.xaxis.take(self._axis_places)
        )

    def solve(self, foot: np.ndarray, legs: Sequence[int] | None = None) -> np.ndarray:
        """Joint angles that put the feet at given places; the inverse of `pose`.

        Every result lies within the joint limits and is finite. A foot place out of reach gives the leg that
        points at it, stretched or folded as far as the limits allow. Of the two bends of a knee, and of the
        two sides of the first hinge, the default pose's are chosen.

        Args:
            foot: (k, 3) m, base frame.
            legs: the k legs that are meant; all if None.

        Returns:
            (k, 3) rad.
        """
        chosen = self._solutions if legs is None else [self._solutions[leg] for leg in legs]
        # Leg by leg: on so few numbers, Python's own arithmetic takes a quarter of NumPy's time.
        return np.array([_leg_angles(place, leg) for place, leg in zip(foot.tolist(), chosen, strict=True)])

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

    def _set_model(self, robot: Robot) -> None:
        """The robot's own model with its base at the origin, and where in it the legs are."""
        self._model = model = load_spec(robot.xml_path).compile()
        self._data = mujoco.MjData(model)
        self._data.qpos[:] = 0.0
        for joint in range(model.njnt):
            if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE:
                self._data.qpos[model.jnt_qposadr[joint] + 3] = 1.0
        joints = np.array([model.joint(name).id for name in robot.joint_names])
        self._addresses = model.jnt_qposadr[joints]
        self._hinges = joints[robot.foot_joints]
        if np.any(model.jnt_type[self._hinges] != mujoco.mjtJoint.mjJNT_HINGE):
            raise UserError(f"{robot.xml_path}: the joints of a leg must be hinges")
        self._geoms = [model.geom(foot.geoms[0]).id for foot in robot.description.feet]
        self._bodies = model.geom_bodyid[self._geoms].tolist()
        self._full_jacobian = np.zeros((self.count, 3, model.nv))
        # Where each leg's (3, 3) stands in the flat arrays of all degrees of freedom, of all axes.
        rows = np.arange(3 * self.count).reshape(self.count, 3, 1)
        self._jacobian_places = rows * model.nv + model.jnt_dofadr[self._hinges][:, None, :]
        self._axis_places = 3 * self._hinges[:, None, :] + np.arange(3)[:, None]
        self.foot_radius = model.geom_size[self._geoms, 0].copy()

    def _zero_pose(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Joint anchors and axes (legs, 3, 3), feet (legs, 3), all joints at zero."""
        data = self._data
        mujoco.mj_kinematics(self._model, data)
        return data.xanchor[self._hinges], data.xaxis[self._hinges], data.geom_xpos[self._geoms]

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

        self._anchor = anchor[:, 0]
        hip = anchor[:, 1] - anchor[:, 0] + _along(upper + lower, normal)
        self._offset = np.sum(hip * normal, axis=1)
        self._plane_origin = _in_plane(hip, x, y)
        flat = np.stack([hip, x, y], axis=2)  # plane coordinates (1, x, y) to the first link
        split = _split_rotation(axis[:, 0])
        self._carry_along, self._carry_across, self._carry_turned = (part @ flat for part in split)
        self._axes_along, self._axes_across, self._axes_turned = (
            (part @ normal[:, :, None])[:, :, 0] for part in split
        )
        if np.any(np.linalg.norm(self._axes_across, axis=1) < _PARALLEL):
            raise UserError(
                f"{robot.xml_path}: the first joint of each leg must not be parallel to the others"
            )

    def _choose_solutions(self, robot: Robot) -> None:
        """Knee bend and side of the first hinge of each leg, from the default pose."""
        low, high = robot.lower_rad[self.joints], robot.upper_rad[self.joints]
        upper, lower = self._link_upper, self._link_lower
        knee_offset = np.angle(lower / upper)
        bent = self.default_angles[:, 2] + knee_offset
        planes = (self._carry_along, self._carry_across, self._carry_turned)
        figures = {
            "anchor": self._anchor,
            "along": self._axes_along,
            "across": self._axes_across + 1j * self._axes_turned,
            "still": planes[0][:, :, 1] + 1j * planes[0][:, :, 2],
            "cosine": planes[1][:, :, 1] + 1j * planes[1][:, :, 2],
            "sine": planes[2][:, :, 1] + 1j * planes[2][:, :, 2],
            "offset": self._offset,
            "side": np.ones(self.count),
            "origin": self._plane_origin,
            "upper": upper,
            "lower": lower,
            "bend": np.where(np.sin(bent) < 0, -1.0, 1.0),
            "square_sum": np.abs(upper) ** 2 + np.abs(lower) ** 2,
            "twice_product": 2 * np.abs(upper) * np.abs(lower),
            "knee_offset": knee_offset,
            "middle": (high + low) / 2,
            "half": (high - low) / 2,
        }
        columns = [values.tolist() for values in figures.values()]
        right = [_Solution(*row) for row in zip(*columns, strict=True)]
        left = [solution._replace(side=-1.0) for solution in right]
        misses = []
        for self._solutions in (left, right):
            misses.append(np.abs(self.solve(self.default_foot) - self.default_angles).max(axis=1))
        nearer = misses[0] < misses[1]
        self._solutions = [a if near else b for a, b, near in zip(left, right, nearer, strict=True)]


class _Solution(NamedTuple):
    """Constants of one leg's inverse kinematics, and which of its solutions is meant.

    The leg's plane turns with the first hinge: of a vector's part in it, one share stays, one goes with the
    cosine of the first angle and one with the sine.
    """

    anchor: list[float]  # (3,) m, on the first hinge
    along: list[float]  # (3,) the parallel axes' part along the first
    across: list[complex]  # (3,) and across it, the imaginary part a quarter turn on
    still: list[complex]  # (3,) a vector's part in the plane: the share that stays
    cosine: list[complex]
    sine: list[complex]
    offset: float  # m, of the foot from the first hinge along the parallel axes
    side: float  # +1 or -1: of the first hinge's two solutions
    origin: complex  # m, the second hinge in the leg's plane
    upper: complex  # m, link from the second hinge to the third
    lower: complex  # m, from the third to the foot
    bend: float  # +1 or -1: of the knee's two solutions
    square_sum: float  # m^2, of the two links' lengths
    twice_product: float  # m^2, of the same
    knee_offset: float  # rad, between the links at zero knee angle
    middle: list[float]  # rad, (3,) of each joint's range
    half: list[float]  # rad, (3,)


def _leg_angles(foot: Sequence[float], leg: _Solution) -> tuple[float, float, float]:
    """The three angles that put one leg's foot at a place in the base frame, m."""
    (x, y, z), (x0, y0, z0) = foot, leg.anchor
    reach = x - x0, y - y0, z - z0
    # The first hinge must bring the reach's part along the parallel axes to its fixed value (Paden and
    # Kahan's fourth subproblem): across cos(q1) + turned sin(q1) = offset - along.
    across = _dot(reach, leg.across)
    turn = leg.side * _arccos((leg.offset - _dot(reach, leg.along).real) / max(abs(across), 1e-9))
    first = _within(cmath.phase(across) + turn, leg.middle[0], leg.half[0])
    # Law of cosines for the knee, then the hip turns the whole two-link arm onto the reach's place.
    place = _dot(reach, leg.still) - leg.origin
    place += math.cos(first) * _dot(reach, leg.cosine) + math.sin(first) * _dot(reach, leg.sine)
    square = place.real * place.real + place.imag * place.imag
    knee = leg.bend * _arccos((square - leg.square_sum) / leg.twice_product)
    third = _within(knee - leg.knee_offset, leg.middle[2], leg.half[2])
    arm = leg.upper + cmath.rect(1.0, third) * leg.lower
    second = _within(cmath.phase(place * arm.conjugate()), leg.middle[1], leg.half[1])
    return first, second, third


def _dot(vector: tuple[float, float, float], row: Sequence[complex]) -> complex:
    return vector[0] * row[0] + vector[1] * row[1] + vector[2] * row[2]


def _arccos(cosine: float) -> float:
    return math.acos(min(max(cosine, -1.0), 1.0))  # in this order, what is not a number stays so


def _within(angle: float, middle: float, half: float) -> float:
    """The turn of an angle that is nearest to the middle of a range, moved into the range."""
    return middle + min(max(wrap_angle(angle - middle), -half), half)


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
