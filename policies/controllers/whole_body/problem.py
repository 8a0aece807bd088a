"""Quadratic program from desired accelerations, and joint torques from its solution.

The unknowns are the forces at the stance points, world axes, and the joints' accelerations. The base has no
motor, so the first six equations of motion give its acceleration: with M = [[Mb, Mc], [.., ..]], the points'
Jacobians J and the bias h, all split into base and joints,

    base acceleration = Mb^-1 (Jb' f - hb - Mc joint acceleration)

Substituted into the other equations, this leaves no equality constraints, and the program is always feasible:
zero forces and free fall with zero torque are allowed. (After Herzog et al. 2016, "Momentum control with
hierarchical inverse dynamics on a torque-controlled humanoid", with weights instead of a hierarchy.)
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from footfall.common.config import require_not_negative, require_positive
from footfall.common.constants import GRAVITY_M_S2
from footfall.common.linear import solve
from footfall.common.rotations import skews
from footfall.policies.controllers.whole_body.dynamics import BASE, Dynamics


@dataclass(frozen=True)
class Weights:
    """Cost of squared deviations. A weight far above another one acts as a priority."""

    contact: float  # acceleration of a stance point, per (m/s^2)^2
    centre: float  # acceleration of the centre of mass, per (m/s^2)^2
    momentum: float  # rate of the angular momentum divided by the mass, per (m^2/s^2)^2
    attitude: float  # angular acceleration of the base, per (rad/s^2)^2
    swing: float  # acceleration of a swing foot, per (m/s^2)^2
    swing_attitude: float  # angular acceleration of a swing foot, per (rad/s^2)^2
    posture: float  # acceleration of each joint, per (rad/s^2)^2
    force: float  # each force, per square of its share of the weight

    def __post_init__(self) -> None:
        require_not_negative(self, "contact", "centre", "momentum", "attitude", "swing", "swing_attitude")
        require_positive(self, "posture", "force")  # > 0, so that the optimum is unique


@dataclass(frozen=True)
class Contact:
    """Friction and damping of stance points."""

    friction: float  # friction coefficient that forces may use
    damping: float  # 1/s, rate at which a moving stance point is slowed down

    def __post_init__(self) -> None:
        require_positive(self, "friction")
        require_not_negative(self, "damping")


class Desired(NamedTuple):
    """Desired accelerations, world axes."""

    centre: np.ndarray  # (3,) m/s^2, centre of mass
    momentum_rate: np.ndarray  # (3,) N m, rate of the angular momentum about the centre of mass
    attitude: np.ndarray  # (3,) rad/s^2, angular acceleration of the base, body frame
    feet: np.ndarray  # (feet, 6) m/s^2 and rad/s^2; used for swing feet
    joints: np.ndarray  # (n,) rad/s^2


class QuadraticProgram(NamedTuple):
    """Minimise x' hessian x / 2 + gradient' x with lower <= (x[:k], rows x) <= upper."""

    hessian: np.ndarray
    gradient: np.ndarray
    rows: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


class TorqueMap(NamedTuple):
    """Affine maps from a solution to accelerations and torques."""

    standing: np.ndarray  # (k,) points in contact
    acceleration: np.ndarray  # (nv, variables)
    acceleration_offset: np.ndarray  # (nv,)
    torque: np.ndarray  # (n, variables)
    torque_offset: np.ndarray  # (n,)


class _Pattern(NamedTuple):
    """Terms that depend only on which points are in contact."""

    standing: np.ndarray  # (k,) points in contact
    swinging: np.ndarray  # feet without a point in contact
    unit: np.ndarray  # (nv, variables) rows of the joints' accelerations; base rows are 0
    momentum: np.ndarray  # (6, variables) weighted rates of the momentum; the angular rows are 0
    damping: np.ndarray  # (variables,) constant diagonal of the Hessian
    cones: np.ndarray  # (4 k + n, variables) friction cones, then rows for the torques, which are 0 here
    lower: np.ndarray  # (3 k + 4 k + n,), 0 for the torques
    upper: np.ndarray  # per N of a point's largest force; 0 for the rest


class QuadraticPrograms:
    """Builds the quadratic programs of one robot.

    Args:
        foot_of_point: (points,) index of the foot of each contact point.
        joints: number of joints, n.
        mass: kg, of the whole robot.
        weights: costs.
        contact: friction.
    """

    def __init__(
        self, foot_of_point: np.ndarray, joints: int, mass: float, weights: Weights, contact: Contact
    ) -> None:
        self._foot_of_point, self._n, self._mass = foot_of_point, joints, mass
        self._weights, self._contact = weights, contact
        self._contact_root = math.sqrt(weights.contact)
        self._attitude_root = math.sqrt(weights.attitude)
        self._centre_root = math.sqrt(weights.centre)
        self._momentum_root = math.sqrt(weights.momentum) / mass
        self._swing_root = np.sqrt(np.repeat([weights.swing, weights.swing_attitude], 3))
        self._patterns: dict[bytes, _Pattern] = {}

    def build(
        self,
        dynamics: Dynamics,
        desired: Desired,
        max_force: np.ndarray,
        min_torque: np.ndarray,
        max_torque: np.ndarray,
    ) -> tuple[QuadraticProgram, TorqueMap]:
        """Quadratic program of one tick.

        Args:
            dynamics: current dynamics of the robot.
            desired: desired accelerations.
            max_force: (points,) N, largest upward force of each point; 0: no contact.
            min_torque: (n,) N m, current lower limits of the motors.
            max_torque: (n,) N m, upper limits.
        """
        pattern = self._pattern(max_force > 0.0)
        standing, n, num_forces = pattern.standing, self._n, 3 * len(pattern.standing)
        jacobian = dynamics.point_jacobian[standing].reshape(num_forces, BASE + n)

        # Accelerations and torques as affine functions of (forces, joint accelerations).
        right_side = np.empty((BASE, num_forces + n + 1))
        right_side[:, :num_forces] = jacobian[:, :BASE].T
        right_side[:, num_forces:-1] = -dynamics.mass[:BASE, BASE:]
        right_side[:, -1] = -dynamics.bias[:BASE]
        base = solve(dynamics.mass[:BASE, :BASE], right_side)
        acceleration = pattern.unit.copy()
        acceleration[:BASE] = base[:, :-1]
        offset = np.zeros(BASE + n)
        offset[:BASE] = base[:, -1]
        torque = dynamics.mass[BASE:, :BASE].dot(base)
        torque_offset = torque[:, -1] + dynamics.bias[BASE:]
        torque = torque[:, :-1]
        torque[:, num_forces:] += dynamics.mass[BASE:, BASE:]
        torque[:, :num_forces] -= jacobian[:, BASE:].T

        matrix, target = self._least_squares(dynamics, desired, pattern, jacobian, acceleration, offset)
        hessian = matrix.T @ matrix
        hessian.flat[:: num_forces + n + 1] += pattern.damping
        gradient = -target.dot(matrix)
        gradient[num_forces:] -= self._weights.posture * desired.joints

        max_force = max_force[standing]
        rows, lower, upper = pattern.cones.copy(), pattern.lower.copy(), pattern.upper.copy()
        rows[-n:] = torque
        lower[:num_forces].reshape(-1, 3)[:] *= max_force[:, None]
        upper[:num_forces].reshape(-1, 3)[:] *= max_force[:, None]
        lower[-n:], upper[-n:] = min_torque - torque_offset, max_torque - torque_offset
        program = QuadraticProgram(hessian, gradient, rows, lower, upper)
        return program, TorqueMap(standing, acceleration, offset, torque, torque_offset)

    def _least_squares(
        self,
        dynamics: Dynamics,
        desired: Desired,
        pattern: _Pattern,
        jacobian: np.ndarray,
        acceleration: np.ndarray,
        offset: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Weighted least squares for matrix @ variables = aim; each row is multiplied by the root of its
        weight."""
        num_forces, contact, attitude = len(jacobian), self._contact_root, self._attitude_root
        swinging = pattern.swinging
        swing_rows = 6 * len(swinging)
        matrix = np.empty((num_forces + 3 + swing_rows + 6, acceleration.shape[1]))
        target = np.empty(len(matrix))
        damping = self._contact.damping * jacobian.dot(dynamics.velocity)
        drift = dynamics.point_drift[pattern.standing].ravel()
        np.multiply(jacobian.dot(acceleration), contact, out=matrix[:num_forces])
        target[:num_forces] = -contact * (drift + damping + jacobian.dot(offset))
        base_rows = slice(num_forces, num_forces + 3)
        matrix[base_rows] = attitude * acceleration[3:BASE]
        target[base_rows] = attitude * (desired.attitude - offset[3:BASE])
        if swing_rows:
            feet = dynamics.foot_jacobian[swinging]
            foot_rows = slice(num_forces + 3, num_forces + 3 + swing_rows)
            root = self._swing_root
            matrix[foot_rows] = (root[:, None] * (feet @ acceleration)).reshape(swing_rows, -1)
            error = desired.feet[swinging] - dynamics.foot_drift[swinging] - feet @ offset
            target[foot_rows] = (root * error).ravel()
        # The momentum's rates depend only on the forces.
        arms = skews(dynamics.point[pattern.standing] - dynamics.centre)
        matrix[-6:] = pattern.momentum
        matrix[-3:, :num_forces] = self._momentum_root * arms.transpose(1, 0, 2).reshape(3, num_forces)
        target[-6:-3] = self._centre_root * (desired.centre - dynamics.gravity)
        target[-3:] = self._momentum_root * desired.momentum_rate
        return matrix, target

    def _pattern(self, stands: np.ndarray) -> _Pattern:
        key = stands.tobytes()
        if key not in self._patterns:
            self._patterns[key] = self._new_pattern(stands)
        return self._patterns[key]

    def _new_pattern(self, stands: np.ndarray) -> _Pattern:
        weights, n, friction = self._weights, self._n, self._contact.friction
        standing = np.flatnonzero(stands)
        k, num_forces = len(standing), 3 * len(standing)
        unit = np.zeros((BASE + n, num_forces + n))
        unit[BASE:, num_forces:] = np.eye(n)
        momentum = np.zeros((6, num_forces + n))
        momentum[:3, :num_forces] = np.tile(self._centre_root / self._mass * np.eye(3), k)
        force = weights.force / (self._mass * GRAVITY_M_S2) ** 2
        cones = np.zeros((4 * k + n, num_forces + n))
        cones[: 4 * k, :num_forces] = _cones(k, friction)
        torques = np.zeros(n)
        return _Pattern(
            standing,
            np.setdiff1d(self._foot_of_point, self._foot_of_point[standing]),
            unit,
            momentum,
            np.concatenate([np.full(num_forces, force), np.full(n, weights.posture)]),
            cones,
            np.concatenate([np.tile([-friction, -friction, 0.0], k), np.full(4 * k, -1e30), torques]),
            np.concatenate([np.tile([friction, friction, 1.0], k), np.zeros(4 * k), torques]),
        )


def _cones(points: int, friction: float) -> np.ndarray:
    """Four-sided friction cones of all points, (4 points, 3 points): rows f <= 0."""
    sides = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    cone = np.column_stack([sides, np.full(4, -friction)])
    return np.kron(np.eye(points), cone)
