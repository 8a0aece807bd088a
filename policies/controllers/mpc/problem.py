"""Quadratic program over the feet's forces, from the state of a rigid body and its contact schedule.

The model is that of Di Carlo et al. 2018 ("Dynamic locomotion in the MIT Cheetah 3 through convex
model-predictive control", eqs. 15-17), written in the heading frame (world rotated by the current yaw), where
for small roll and pitch

    d attitude = rate,   d rate = I^-1 sum r x f,   d position = velocity,   d velocity = g + sum f / m.

Its state matrix A is nilpotent (A^2 = 0 except for gravity, which is integrated separately), so the exact
discretisation has a closed form: a force f during step j changes rates after step k >= j by dt, and attitude
and position by dt^2 (k - j + 1/2), times its acceleration. The program is condensed: its only variables are
the forces of feet in contact. With one weight per state, the Hessian is a few products of small matrices.

A sole also exerts a moment m about its middle, which adds I^-1 m to the angular acceleration. Its centre of
pressure stays within the sole if |m| <= lever * upward force; friction bounds the moment about z.
The cost of force changes covers every foot, whose force is zero in swing. So it also covers the load that a
foot takes up after landing and gives up before lift-off.
"""

from typing import NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.mpc.config import Contact, Horizon, Weights
from footfall.policies.controllers.mpc.wrenches import Wrenches
from footfall.robots.rigid_body import RigidBody

_DOWN = np.array([0.0, 0.0, -GRAVITY_M_S2])
_AXES = [2, 0, 1]  # forces are sorted z, x, y: daqp expects variables with simple bounds first
_FORCE_AXES = [5, 3, 4]  # the same for the last three of six components


class BodyState(NamedTuple):
    """Motion of the centre of mass in the heading frame: each (6,), or (steps, 6) for a reference."""

    pose: np.ndarray  # roll, pitch, yaw, rad; position, m
    rate: np.ndarray  # angular rate, rad/s; velocity, m/s


class ForceProblem(NamedTuple):
    """minimise x' H x / 2 + g' x, subject to 0 <= x[:n] <= upper[:n] and rows x <= 0.

    Each of the n contacts (foot, step) has k variables: 3 for a point, 6 for a sole.
    """

    hessian: np.ndarray  # (k n, k n)
    gradient: np.ndarray  # (k n,)
    rows: np.ndarray  # (r n, k n): friction pyramids (r = 4), then limits of moments (6 more)
    upper: np.ndarray  # (n + r n,), bounds of the n upward forces, then of the rows
    lower: np.ndarray  # (n + r n,)
    step: np.ndarray  # (n,) step of each contact
    leg: np.ndarray  # (n,) foot of each contact


class _Pattern(NamedTuple):
    """Terms that the contact schedule fixes."""

    step: np.ndarray
    leg: np.ndarray
    num_first: int  # number of contacts in the first step, which come first
    pose_coupling: np.ndarray  # (k n, k n) coupling of two forces through attitude and position
    rate_coupling: np.ndarray  # (k n, k n) coupling of two forces through the rates
    linear: np.ndarray  # (k n, k n) Hessian of the translation, of the forces and of their changes
    even_gradient: np.ndarray  # (n,) gradient towards equal upward forces that carry the weight
    rows: np.ndarray
    upper: np.ndarray
    lower: np.ndarray


class ForceProblems:
    """Builds the quadratic programs of one robot.

    Args:
        body: mass and inertia.
        horizon, weights, contact: settings.
        levers: (legs, 3) m, largest moment of each sole per upward force, about x, y and (per friction
            coefficient) z; None for point feet.
    """

    def __init__(
        self,
        body: RigidBody,
        horizon: Horizon,
        weights: Weights,
        contact: Contact,
        levers: np.ndarray | None = None,
    ) -> None:
        steps, dt_s = horizon.steps, horizon.step_s
        self._body, self._weights, self._contact = body, weights, contact
        self._levers, self._variables = levers, 3 if levers is None else 6
        self._angular_per_force = _angular_per_force(body.inverse_inertia)
        steps_after = np.arange(steps)[:, None] - np.arange(steps)[None, :]  # steps from force j to state k
        self._pose_by_force = np.where(steps_after >= 0, dt_s**2 * (steps_after + 0.5), 0.0)
        self._rate_by_force = np.where(steps_after >= 0, dt_s, 0.0)
        self._weight_pose = np.array([*weights.attitude, *weights.position])
        self._weight_rate = np.array([*weights.angular_rate, *weights.velocity])
        # Rows: poses after all steps, then rates. Columns of `_free`: effect of state, rate and gravity
        # without any force. `_weight`: their weights. `_by_force`: effect of forces.
        times, ones, zeros = dt_s * np.arange(1, steps + 1), np.ones(steps), np.zeros(steps)
        self._free = np.array([[ones, times, times**2 / 2], [zeros, ones, times]]).transpose(0, 2, 1)
        self._free = self._free.reshape(2 * steps, 3)
        self._by_force = np.concatenate([self._pose_by_force, self._rate_by_force]).T
        self._weight = np.repeat([self._weight_pose, self._weight_rate], steps, axis=0)
        difference = np.eye(steps) - np.eye(steps, k=-1)  # change of a force from the previous step
        self._change = weights.force_change * difference.T @ difference
        self._patterns: dict[tuple[bytes, float], _Pattern] = {}

    def build(
        self,
        state: BodyState,
        reference: BodyState,
        contacts: np.ndarray,
        feet: np.ndarray,
        previous_force: np.ndarray,
        friction: float | None = None,
        gravity: np.ndarray = _DOWN,
    ) -> ForceProblem:
        """Quadratic program for the current state.

        Args:
            state: current state.
            reference: desired state after each step.
            contacts: (steps, legs) boolean, feet in stance during each step.
            feet: (steps, legs, 3) m, contact points relative to the centre of mass, heading frame.
            previous_force: (legs, 3) N, forces applied last, heading frame; 0 for feet in swing.
            friction: coefficient that the forces may use; None: the one in the settings.
            gravity: (3,) m/s^2, heading frame, whose z axis is the ground's normal.
        """
        pattern = self._pattern(contacts, friction or self._contact.friction)
        n, k = len(pattern.step), self._variables
        angular = (self._angular_per_force @ feet[pattern.step, pattern.leg].T).reshape(3, 3, n)
        if k > 3:
            moments = np.broadcast_to(self._body.inverse_inertia[:, :, None], (3, 3, n))
            angular = np.concatenate([angular, moments], axis=1)
        flat = angular.reshape(3, k * n)
        hessian = flat.T @ (self._weight_pose[:3, None] * flat)
        hessian *= pattern.pose_coupling
        by_rate = flat.T @ (self._weight_rate[:3, None] * flat)
        by_rate *= pattern.rate_coupling
        hessian += by_rate
        hessian += pattern.linear

        # State without any force, minus the reference.
        deviation = self._free.dot(np.array([state.pose, state.rate, [0.0, 0.0, 0.0, *gravity.tolist()]]))
        deviation -= np.concatenate(reference)
        # Gradient of the cost by the acceleration in each step, (steps, 6), then for each contact, (6, n).
        acceleration_gradient = self._by_force.dot(self._weight * deviation)
        acceleration_gradient = acceleration_gradient.take(pattern.step, axis=0).T
        gradient = (angular * acceleration_gradient[:3, None]).sum(axis=0)
        gradient[:3] += acceleration_gradient[_FORCE_AXES] / self._body.mass
        gradient[0] -= pattern.even_gradient
        legs = pattern.leg[: pattern.num_first]
        gradient[:3, : pattern.num_first] -= self._weights.force_change * previous_force[legs].T[_AXES]
        return ForceProblem(
            hessian,
            gradient.reshape(k * n),
            pattern.rows,
            pattern.upper,
            pattern.lower,
            pattern.step,
            pattern.leg,
        )

    def wrenches(self, solution: np.ndarray, problem: ForceProblem, legs: int) -> Wrenches:
        """Wrenches of the feet in the first step, heading frame, from a solution (k n,)."""
        force, moment = np.zeros((2, legs, 3))
        num_first = np.count_nonzero(problem.step == 0)
        legs_in_stance = problem.leg[:num_first]
        variables = solution.reshape(self._variables, -1)[:, :num_first]
        z, x, y = variables[:3]
        force[legs_in_stance] = np.array([x, y, z]).T
        if len(variables) > 3:
            moment[legs_in_stance] = variables[3:].T
        return Wrenches(force, moment)

    def _pattern(self, contacts: np.ndarray, friction: float) -> _Pattern:
        key = contacts.tobytes(), friction
        if key not in self._patterns:
            self._patterns[key] = self._new_pattern(contacts, friction)
        return self._patterns[key]

    def _new_pattern(self, contacts: np.ndarray, friction: float) -> _Pattern:
        step, leg = np.nonzero(contacts)
        n, k = len(step), self._variables
        pose_coupling = (self._pose_by_force.T @ self._pose_by_force)[np.ix_(step, step)]
        rate_coupling = (self._rate_by_force.T @ self._rate_by_force)[np.ix_(step, step)]
        change = self._change[np.ix_(step, step)] * (leg[:, None] == leg)
        linear = np.diag(np.repeat([self._weights.force, self._weights.moment], [3 * n, (k - 3) * n]))
        linear[: 3 * n, : 3 * n] += np.kron(np.eye(3), change)
        for axis, state in enumerate(_FORCE_AXES):
            block = slice(axis * n, (axis + 1) * n)
            coupling = self._weight_pose[state] * pose_coupling + self._weight_rate[state] * rate_coupling
            linear[block, block] += coupling / self._body.mass**2
        # For each variable except the upward force: its largest ratio to the upward force.
        ratios = [np.full(n, friction)] * 2
        if self._levers is not None:
            ratios += list((self._levers[leg] * [1.0, 1.0, friction]).T)
        rows = _pyramids(ratios)
        num_stance = np.maximum(contacts.sum(axis=1), 1)[step]
        return _Pattern(
            step,
            leg,
            int(contacts[0].sum()),
            np.tile(pose_coupling, (k, k)),
            np.tile(rate_coupling, (k, k)),
            linear,
            self._weights.force * self._body.mass * GRAVITY_M_S2 / num_stance,
            rows,
            np.concatenate([np.full(n, self._contact.max_force_n), np.zeros(len(rows))]),
            np.concatenate([np.zeros(n), np.full(len(rows), -1e30)]),
        )


def _pyramids(ratios: list[np.ndarray]) -> np.ndarray:
    """Rows (2 r n, (1 + r) n) that keep each of r variables within a ratio (n,) of the upward force."""
    size = len(ratios[0])
    rows = np.zeros((len(ratios), 2, size, 1 + len(ratios), size))
    for variable, ratio in enumerate(ratios):
        rows[variable, :, :, 0] = -np.diag(ratio)
        rows[variable, 0, :, 1 + variable], rows[variable, 1, :, 1 + variable] = np.eye(size), -np.eye(size)
    return rows.reshape(2 * len(ratios) * size, (1 + len(ratios)) * size)


def _angular_per_force(inverse_inertia: np.ndarray) -> np.ndarray:
    """Matrix (9, 3) whose product with a force's arm (3,) gives the angular acceleration per force.
    The 9 rows are: axis of the acceleration (3), by axis of the force (3, sorted z, x, y).
    """
    torque = np.zeros((3, 3, 3))  # axis of torque, of force, of arm: the cross product
    for axis in range(3):
        x, y = (axis + 1) % 3, (axis + 2) % 3
        torque[axis, y, x], torque[axis, x, y] = 1.0, -1.0
    return (inverse_inertia @ torque[:, _AXES].reshape(3, 9)).reshape(9, 3)
