"""From the state of a rigid body and its coming contacts to a quadratic programme over the feet's forces.

The model is that of Di Carlo et al. 2018 ("Dynamic locomotion in the MIT Cheetah 3 through convex
model-predictive control", eqs. 15-17), written in the heading frame (world turned by the present yaw), where
for small roll and pitch

    d attitude = rate,   d rate = I^-1 sum r x f,   d position = velocity,   d velocity = g + sum f / m.

Its A is nilpotent (A^2 = 0 but for gravity, which is integrated by hand), so the exact discretisation
has a closed form: a force f held during step j changes rates after step k >= j by dt, and attitude and
position by dt^2 (k - j + 1/2), times its acceleration. The programme is condensed: its only variables are
the forces of feet in contact. With a weight per state, the Hessian is a few products of small matrices.

The forces' changes that cost are those of every foot, which presses with nothing while it swings: also the
load that a foot takes up as it lands and gives up before it is lifted.
"""

from typing import NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.mpc.config import Contact, Horizon, Weights
from footfall.robots.rigid_body import RigidBody

_FALL = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -GRAVITY_M_S2])
_AXES = [2, 0, 1]  # forces are sorted z, x, y: daqp wants variables with plain bounds first
_FORCE_AXES = [5, 3, 4]  # the same of the last three of six


class BodyState(NamedTuple):
    """Motion of the centre of mass in the heading frame: each (6,), or (steps, 6) for a reference."""

    pose: np.ndarray  # roll, pitch, yaw, rad; position, m
    rate: np.ndarray  # angular rate, rad/s; velocity, m/s


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
    """Terms that the contact schedule fixes."""

    step: np.ndarray
    leg: np.ndarray
    now: int  # how many of the n are the first step's; they come first
    second: np.ndarray  # (3n, 3n) weight shared by two forces through attitude and position
    first: np.ndarray  # (3n, 3n) the same through the rates
    linear: np.ndarray  # (3n, 3n) Hessian of the translation, of the forces themselves and of their changes
    even_pull: np.ndarray  # (n,) gradient towards the upward forces that share the weight evenly
    rows: np.ndarray
    upper: np.ndarray
    lower: np.ndarray


class ForceProblems:
    """Builds the quadratic programmes of one robot."""

    def __init__(self, body: RigidBody, horizon: Horizon, weights: Weights, contact: Contact) -> None:
        steps, dt_s = horizon.steps, horizon.step_s
        self._body, self._weights, self._contact = body, weights, contact
        self._turning = _turning(np.linalg.inv(body.inertia))
        late = np.arange(steps)[:, None] - np.arange(steps)[None, :]  # of state k after force j
        self._second = np.where(late >= 0, dt_s**2 * (late + 0.5), 0.0)
        self._first = np.where(late >= 0, dt_s, 0.0)
        self._weight_pose = np.array([*weights.attitude, *weights.position])
        self._weight_rate = np.array([*weights.angular_rate, *weights.velocity])
        # Of the poses after all steps, then of the rates: what state, rate and gravity make of them without
        # any force, their weights, and what forces make of them.
        times, one, none = dt_s * np.arange(1, steps + 1), np.ones(steps), np.zeros(steps)
        self._free = np.array([[one, times, times**2 / 2], [none, one, times]]).transpose(0, 2, 1)
        self._free = self._free.reshape(2 * steps, 3)
        self._by_force = np.concatenate([self._second, self._first]).T
        self._weight = np.repeat([self._weight_pose, self._weight_rate], steps, axis=0)
        difference = np.eye(steps) - np.eye(steps, k=-1)  # of a force from the step before
        self._change = weights.force_change * difference.T @ difference
        self._patterns: dict[tuple[bytes, float], _Pattern] = {}

    def build(
        self,
        state: BodyState,
        reference: BodyState,
        contacts: np.ndarray,
        feet: np.ndarray,
        before: np.ndarray,
        friction: float | None = None,
    ) -> ForceProblem:
        """The programme for one moment.

        Args:
            state: now.
            reference: wanted after each step.
            contacts: (steps, legs) boolean, feet in stance during each step.
            feet: (steps, legs, 3) m, points of contact from the centre of mass, heading frame.
            before: (legs, 3) N, forces that were applied last, heading frame; of feet that swung 0.
            friction: coefficient that the forces count on; None: the settings'.
        """
        pattern = self._pattern(contacts, friction or self._contact.friction)
        n = len(pattern.step)
        turn = (self._turning @ feet[pattern.step, pattern.leg].T).reshape(3, 3, n)
        flat = turn.reshape(3, 3 * n)
        hessian = flat.T @ (self._weight_pose[:3, None] * flat)
        hessian *= pattern.second
        by_rate = flat.T @ (self._weight_rate[:3, None] * flat)
        by_rate *= pattern.first
        hessian += by_rate
        hessian += pattern.linear

        # Where the body would be without any force, against where it should be.
        deviation = self._free.dot(np.array([state.pose, state.rate, _FALL]))
        deviation -= np.concatenate(reference)
        pull = self._by_force.dot(self._weight * deviation)  # (steps, 6)
        pull = pull.take(pattern.step, axis=0).T  # (6, n)
        gradient = (turn * pull[:3, None]).sum(axis=0)
        gradient += pull[_FORCE_AXES] / self._body.mass
        gradient[0] -= pattern.even_pull
        now = pattern.leg[: pattern.now]
        gradient[:, : pattern.now] -= self._weights.force_change * before[now].T[_AXES]
        return ForceProblem(
            hessian,
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
        now = np.count_nonzero(problem.step == 0)
        z, x, y = solution.reshape(3, -1)[:, :now]
        result[problem.leg[:now]] = np.array([x, y, z]).T
        return result

    def _pattern(self, contacts: np.ndarray, friction: float) -> _Pattern:
        key = contacts.tobytes(), friction
        if key not in self._patterns:
            self._patterns[key] = self._new_pattern(contacts, friction)
        return self._patterns[key]

    def _new_pattern(self, contacts: np.ndarray, friction: float) -> _Pattern:
        step, leg = np.nonzero(contacts)
        n = len(step)
        second = (self._second.T @ self._second)[np.ix_(step, step)]
        first = (self._first.T @ self._first)[np.ix_(step, step)]
        change = self._change[np.ix_(step, step)] * (leg[:, None] == leg)
        linear = self._weights.force * np.eye(3 * n) + np.kron(np.eye(3), change)
        for axis, state in enumerate(_FORCE_AXES):
            block = slice(axis * n, (axis + 1) * n)
            shared = self._weight_pose[state] * second + self._weight_rate[state] * first
            linear[block, block] += shared / self._body.mass**2
        cone = friction * np.eye(n)
        none = np.zeros((n, n))
        rows = np.block(
            [
                [-cone, np.eye(n), none],
                [-cone, -np.eye(n), none],
                [-cone, none, np.eye(n)],
                [-cone, none, -np.eye(n)],
            ]
        )
        standing = np.maximum(contacts.sum(axis=1), 1)[step]
        return _Pattern(
            step,
            leg,
            int(contacts[0].sum()),
            np.tile(second, (3, 3)),
            np.tile(first, (3, 3)),
            linear,
            self._weights.force * self._body.mass * GRAVITY_M_S2 / standing,
            rows,
            np.concatenate([np.full(n, self._contact.most_force_n), np.zeros(4 * n)]),
            np.concatenate([np.zeros(n), np.full(4 * n, -1e30)]),
        )


def _turning(inverse_inertia: np.ndarray) -> np.ndarray:
    """Angular acceleration by force as a matrix (9, 3) that waits for the force's arm (3,).

    Its rows are acceleration's axis (3,) by the force's (3, sorted z, x, y).
    """
    torque = np.zeros((3, 3, 3))  # by torque's axis, force's axis, arm's axis: the cross product
    for axis in range(3):
        x, y = (axis + 1) % 3, (axis + 2) % 3
        torque[axis, y, x], torque[axis, x, y] = 1.0, -1.0
    return (inverse_inertia @ torque[:, _AXES].reshape(3, 9)).reshape(9, 3)
