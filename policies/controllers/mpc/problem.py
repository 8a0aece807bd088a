"""From the state of a rigid body and its coming contacts to a quadratic programme over the feet's forces.

The model is that of Di Carlo et al. 2018 ("Dynamic locomotion in the MIT Cheetah 3 through convex
model-predictive control", eqs. 15-17), written in the heading frame (world turned by the present yaw), where
for small roll and pitch

    d attitude = rate,   d rate = I^-1 sum r x f,   d position = velocity,   d velocity = g + sum f / m.

Its A is nilpotent (A^2 = 0 apart from gravity, which is integrated by hand), so the exact discretisation
has a closed form: a force f held during step j changes rates after step k >= j by dt, and attitude and
position by dt^2 (k - j + 1/2), times its acceleration. The programme is condensed: its only variables are
the forces of feet in contact. With a weight per state, the Hessian is a few products of small matrices.
"""

from typing import NamedTuple

import numpy as np

from footfall.policies.controllers.mpc.config import Contact, Horizon, Weights
from footfall.robots.rigid_body import RigidBody

GRAVITY = 9.81
_AXES = [2, 0, 1]  # forces are sorted z, x, y: daqp wants variables with plain bounds first


class BodyState(NamedTuple):
    """Motion of the centre of mass in the heading frame: each (3,), or (steps, 3) for a reference."""

    attitude: np.ndarray  # roll, pitch, yaw, rad
    position: np.ndarray  # m
    angular_rate: np.ndarray  # rad/s
    velocity: np.ndarray  # m/s


class ForceProblem(NamedTuple):
    """minimise x' H x / 2 + g' x, subject to 0 <= x[:n] <= most and rows x <= 0."""

    hessian: np.ndarray  # (3n, 3n), n feet in contact over all steps
    gradient: np.ndarray  # (3n,)
    rows: np.ndarray  # (4n, 3n), friction pyramids
    upper: np.ndarray  # (5n,), bounds of the n upward forces, then of the rows
    lower: np.ndarray  # (5n,)
    step: np.ndarray  # (n,) when
    leg: np.ndarray  # (n,) which foot


class _Pattern(NamedTuple):
    """All that depends on who stands when, and on nothing else."""

    step: np.ndarray
    leg: np.ndarray
    second: np.ndarray  # (n, n) weight shared by two forces through attitude and position
    first: np.ndarray  # (n, n) the same through the rates
    linear: np.ndarray  # (3, n, n) Hessian of the translation, per axis
    even_share: np.ndarray  # (n,) upward force that carries the weight in each step
    rows: np.ndarray
    upper: np.ndarray
    lower: np.ndarray


class ForceProblems:
    """Builds the quadratic programmes of one robot."""

    def __init__(self, body: RigidBody, horizon: Horizon, weights: Weights, contact: Contact) -> None:
        steps, dt_s = horizon.steps, horizon.step_s
        self._body, self._weights, self._contact = body, weights, contact
        self._inverse_inertia = np.linalg.inv(body.inertia)
        late = np.arange(steps)[:, None] - np.arange(steps)[None, :]  # of state k after force j
        self._second = np.where(late >= 0, dt_s**2 * (late + 0.5), 0.0)
        self._first = np.where(late >= 0, dt_s, 0.0)
        self._times = dt_s * np.arange(1, steps + 1)[:, None]
        self._fall = np.array([0.0, 0.0, -GRAVITY])
        self._weight_attitude = np.array(weights.attitude)
        self._weight_position = np.array(weights.position)
        self._weight_rate = np.array(weights.angular_rate)
        self._weight_velocity = np.array(weights.velocity)
        self._patterns: dict[bytes, _Pattern] = {}

    def build(
        self, state: BodyState, reference: BodyState, contacts: np.ndarray, feet: np.ndarray
    ) -> ForceProblem:
        """The programme for one moment.

        Args:
            state: now.
            reference: wanted after each step.
            contacts: (steps, legs) boolean, who stands during each step.
            feet: (steps, legs, 3) m, points of contact from the centre of mass, heading frame.
        """
        pattern = self._pattern(contacts)
        n = len(pattern.step)
        turn = self._turning(feet[pattern.step, pattern.leg])  # (3, 3, n)
        flat = turn.reshape(3, 3 * n)
        hessian = (
            (flat.T @ (self._weight_attitude[:, None] * flat)).reshape(3, n, 3, n)
            * pattern.second[:, None, :]
        ) + ((flat.T @ (self._weight_rate[:, None] * flat)).reshape(3, n, 3, n) * pattern.first[:, None, :])
        for axis in range(3):
            hessian[axis, :, axis, :] += pattern.linear[axis]

        # Where the body would be without any force, against where it should be.
        time = self._times
        attitude = state.attitude + time * state.angular_rate - reference.attitude
        rate = state.angular_rate - reference.angular_rate
        velocity = state.velocity + time * self._fall - reference.velocity
        position = state.position + time * state.velocity - reference.position
        position += 0.5 * time**2 * self._fall
        torque_pull = self._second.T @ (attitude * self._weight_attitude)
        torque_pull += self._first.T @ (rate * self._weight_rate)
        force_pull = self._second.T @ (position * self._weight_position)
        force_pull += self._first.T @ (velocity * self._weight_velocity)
        gradient = np.einsum("icn,ni->cn", turn, torque_pull[pattern.step])
        gradient += force_pull[pattern.step][:, _AXES].T / self._body.mass
        gradient[0] -= self._weights.force * pattern.even_share
        return ForceProblem(
            hessian.reshape(3 * n, 3 * n),
            gradient.reshape(3 * n),
            pattern.rows,
            pattern.upper,
            pattern.lower,
            pattern.step,
            pattern.leg,
        )

    def forces(self, solution: np.ndarray, problem: ForceProblem, legs: int) -> np.ndarray:
        """The first step's forces (legs, 3) in N, heading frame, from a solution (3n,)."""
        result = np.zeros((legs, 3))
        now = problem.step == 0
        result[problem.leg[now]] = solution.reshape(3, -1)[:, now].T[:, [1, 2, 0]]
        return result

    def _turning(self, arm: np.ndarray) -> np.ndarray:
        """Angular acceleration (3,) by force component (3, sorted z, x, y) of each arm: (3, 3, n)."""
        x, y, z = arm.T
        zero = np.zeros_like(x)
        torque = np.array([[y, zero, -z], [-x, z, zero], [zero, -y, x]])
        return (self._inverse_inertia @ torque.reshape(3, -1)).reshape(torque.shape)

    def _pattern(self, contacts: np.ndarray) -> _Pattern:
        key = contacts.tobytes()
        if key not in self._patterns:
            self._patterns[key] = self._new_pattern(contacts)
        return self._patterns[key]

    def _new_pattern(self, contacts: np.ndarray) -> _Pattern:
        step, leg = np.nonzero(contacts)
        n = len(step)
        second = (self._second.T @ self._second)[np.ix_(step, step)]
        first = (self._first.T @ self._first)[np.ix_(step, step)]
        linear = (
            self._weight_position[_AXES, None, None] * second
            + self._weight_velocity[_AXES, None, None] * first
        ) / self._body.mass**2
        linear += self._weights.force * np.eye(n)
        friction = self._contact.friction * np.eye(n)
        none = np.zeros((n, n))
        rows = np.block(
            [
                [-friction, np.eye(n), none],
                [-friction, -np.eye(n), none],
                [-friction, none, np.eye(n)],
                [-friction, none, -np.eye(n)],
            ]
        )
        standing = np.maximum(contacts.sum(axis=1), 1)[step]
        return _Pattern(
            step,
            leg,
            second,
            first,
            linear,
            self._body.mass * GRAVITY / standing,
            rows,
            np.concatenate([np.full(n, self._contact.most_force_n), np.zeros(4 * n)]),
            np.concatenate([np.zeros(n), np.full(4 * n, -1e30)]),
        )
