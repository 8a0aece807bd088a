"""From wanted accelerations to a quadratic programme, and from its solution to joint torques.

The unknowns are the forces of the standing points, world axes, and the joints' accelerations. The base has no
motor, so the first six equations of motion give its acceleration: with M = [[Mb, Mc], [.., ..]], the points'
Jacobians J and the bias h, all split into base and joints,

    base acceleration = Mb^-1 (Jb' f - hb - Mc joint acceleration)

Put into the others, what remains has no equalities and is never infeasible: no force at all and falling
freely with motors at rest is always allowed. (After Herzog et al. 2016, "Momentum control with hierarchical
inverse dynamics on a torque-controlled humanoid", with weights instead of a hierarchy.)
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from footfall.common.config import require_not_negative, require_positive
from footfall.policies.controllers.whole_body.dynamics import BASE, Dynamics, skews

GRAVITY = np.array([0.0, 0.0, -9.81])


@dataclass(frozen=True)
class Weights:
    """Cost of squared deviations from what is wanted. Large next to small: nearly a priority."""

    contact: float  # of a standing point's acceleration, per (m/s^2)^2
    centre: float  # of the centre of mass's acceleration, per (m/s^2)^2
    momentum: float  # of the angular momentum's rate over the mass, per (m^2/s^2)^2
    attitude: float  # of the base's angular acceleration, per (rad/s^2)^2
    swing: float  # of a swinging foot's acceleration, per (m/s^2)^2
    swing_attitude: float  # per (rad/s^2)^2
    posture: float  # of each joint's acceleration, per (rad/s^2)^2
    force: float  # of each force, as shares of the weight

    def __post_init__(self) -> None:
        require_not_negative(self, "contact", "centre", "momentum", "attitude", "swing", "swing_attitude")
        require_positive(self, "posture", "force")  # so that there is one best solution


@dataclass(frozen=True)
class Contact:
    """What a standing point may press with, and how firmly it stands."""

    friction: float  # coefficient that the controller counts on
    damping_s: float  # 1/s: a standing point that moves is slowed at this rate

    def __post_init__(self) -> None:
        require_positive(self, "friction")
        require_not_negative(self, "damping_s")


class Wanted(NamedTuple):
    """Accelerations to come as close to as possible, world axes."""

    centre: np.ndarray  # (3,) m/s^2, of the centre of mass
    momentum_rate: np.ndarray  # (3,) N m, of the angular momentum about it
    attitude: np.ndarray  # (3,) rad/s^2, of the base, body frame
    feet: np.ndarray  # (feet, 6) m/s^2 and rad/s^2; of feet that swing
    joints: np.ndarray  # (n,) rad/s^2


class Programme(NamedTuple):
    """Minimise x' hessian x / 2 + gradient' x with lower <= (x[:k], rows x) <= upper."""

    hessian: np.ndarray
    gradient: np.ndarray
    rows: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


class TorqueMap(NamedTuple):
    """What a solution means."""

    standing: np.ndarray  # (k,) points that may press
    acceleration: np.ndarray  # (nv, variables)
    acceleration_offset: np.ndarray  # (nv,)
    torque: np.ndarray  # (n, variables)
    torque_offset: np.ndarray  # (n,)


def build(
    dynamics: Dynamics,
    wanted: Wanted,
    most_force: np.ndarray,
    foot_of_point: np.ndarray,
    least_torque: np.ndarray,
    most_torque: np.ndarray,
    weights: Weights,
    contact: Contact,
    mass: float,
) -> tuple[Programme, TorqueMap]:
    """The programme of one tick.

    Args:
        dynamics: of the robot now.
        wanted: accelerations.
        most_force: (points,) N, upward, that each point may press with; 0 where it does not stand.
        foot_of_point: (points,) index of its foot.
        least_torque: (n,) N m, of the motors now.
        most_torque: (n,) N m.
        weights: costs.
        contact: friction.
        mass: kg, of the whole robot.
    """
    standing = np.flatnonzero(most_force > 0.0)
    forces, n = 3 * len(standing), len(wanted.joints)
    jacobian = dynamics.point_jacobian[standing].reshape(forces, -1)

    # Accelerations and torques as affine functions of (forces, joint accelerations).
    right = np.concatenate(
        [jacobian[:, :BASE].T, -dynamics.mass[:BASE, BASE:], -dynamics.bias[:BASE, None]], axis=1
    )
    base = np.linalg.solve(dynamics.mass[:BASE, :BASE], right)
    acceleration = np.zeros((BASE + n, forces + n))
    acceleration[:BASE] = base[:, :-1]
    acceleration[BASE:, forces:] = np.eye(n)
    offset = np.zeros(BASE + n)
    offset[:BASE] = base[:, -1]
    of_base = dynamics.mass[BASE:, :BASE]
    torque = of_base @ base[:, :-1]
    torque[:, forces:] += dynamics.mass[BASE:, BASE:]
    torque[:, :forces] -= jacobian[:, BASE:].T
    torque_offset = of_base @ base[:, -1] + dynamics.bias[BASE:]

    # Rows of a least-squares problem in the acceleration, each times the root of its weight.
    swinging = np.ones(len(wanted.feet), dtype=bool)
    swinging[foot_of_point[standing]] = False
    swing_root = np.sqrt(np.repeat([weights.swing, weights.swing_attitude], 3))
    slowing = contact.damping_s * (jacobian @ dynamics.velocity)
    roots = np.sqrt([weights.contact, weights.attitude])
    rows = np.concatenate(
        [
            roots[0] * jacobian,
            roots[1] * np.eye(BASE + n)[3:BASE],
            (swing_root[:, None] * dynamics.foot_jacobian[swinging]).reshape(-1, BASE + n),
        ]
    )
    aims = np.concatenate(
        [
            -roots[0] * (dynamics.point_drift[standing].ravel() + slowing),
            roots[1] * wanted.attitude,
            (swing_root * (wanted.feet - dynamics.foot_drift)[swinging]).ravel(),
        ]
    )
    # What forces alone decide: the momentum's rates.
    arms = skews(dynamics.point[standing] - dynamics.centre)
    centre = np.sqrt(weights.centre) / mass
    momentum = np.sqrt(weights.momentum) / mass
    by_forces = np.zeros((6, forces + n))
    by_forces[:3, :forces] = np.tile(centre * np.eye(3), len(standing))
    by_forces[3:, :forces] = momentum * arms.transpose(1, 0, 2).reshape(3, forces)
    matrix = np.concatenate([rows @ acceleration, by_forces])
    aim = np.concatenate(
        [aims - rows @ offset, centre * mass * (wanted.centre - GRAVITY), momentum * wanted.momentum_rate]
    )
    hessian = matrix.T @ matrix
    gradient = -(aim @ matrix)
    hessian.flat[:: forces + n + 1] += np.concatenate(
        [np.full(forces, weights.force / (mass * GRAVITY[2]) ** 2), np.full(n, weights.posture)]
    )
    gradient[forces:] -= weights.posture * wanted.joints

    most = most_force[standing]
    cone = _cones(len(standing), contact.friction)
    sideways = contact.friction * most
    top = np.column_stack([sideways, sideways, most]).ravel()
    bottom = np.column_stack([-sideways, -sideways, np.zeros_like(most)]).ravel()
    friction_rows = np.zeros((len(cone), forces + n))
    friction_rows[:, :forces] = cone
    unbounded = np.full(len(cone), -1e30)
    return (
        Programme(
            hessian,
            gradient,
            np.concatenate([friction_rows, torque]),
            np.concatenate([bottom, unbounded, least_torque - torque_offset]),
            np.concatenate([top, np.zeros(len(cone)), most_torque - torque_offset]),
        ),
        TorqueMap(standing, acceleration, offset, torque, torque_offset),
    )


def _cones(points: int, friction: float) -> np.ndarray:
    """Four-sided friction cones of points, (4 points, 3 points): rows f <= 0."""
    sides = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    one = np.column_stack([sides, np.full(4, -friction)])
    return np.kron(np.eye(points), one)
