"""The quadratic program of the MPC and its solvers, against brute force."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.linalg import expm

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.mpc.config import Contact, Horizon, Weights
from footfall.policies.controllers.mpc.problem import BodyState, ForceProblems
from footfall.policies.controllers.solver import BoundedSolver
from footfall.robots.description import load_robot
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("go1")
BODY = nominal_body(ROBOT)
HORIZON = Horizon(steps=6, step_s=0.03, solve_hz=100.0)
WEIGHTS = Weights((9.0, 8.0, 7.0), (2.0, 3.0, 50.0), (0.1, 0.2, 0.3), (1.0, 1.5, 0.4), 1e-4, 3e-4)
CONTACT = Contact(friction=0.6, max_force_n=150.0)
PROBLEMS = ForceProblems(BODY, HORIZON, WEIGHTS, CONTACT)
FEET = np.array([[0.19, -0.13, -0.25], [0.19, 0.13, -0.25], [-0.19, -0.13, -0.25], [-0.19, 0.13, -0.25]])


class Situation(NamedTuple):
    """Inputs of a plan."""

    state: BodyState
    reference: BodyState
    contacts: np.ndarray
    feet: np.ndarray
    before: np.ndarray


def random_situation(seed: int, standing: bool = False) -> Situation:
    rng = np.random.default_rng(seed)
    state = BodyState(*(0.3 * rng.standard_normal((2, 6))))
    reference = BodyState(*(0.1 * rng.standard_normal((2, HORIZON.steps, 6))))
    contacts = rng.uniform(size=(HORIZON.steps, 4)) < 0.6
    contacts[:, 0] = True
    if standing:
        contacts[:] = True
    feet = FEET + 0.05 * rng.standard_normal((HORIZON.steps, 4, 3))
    before = rng.uniform(-10.0, 60.0, (4, 3)) * [[1.0], [0.0], [1.0], [1.0]]
    return Situation(state, reference, contacts, feet, before)


def system(arms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The continuous system of a body (12 states and a constant 1) on its feet: x' = A x + B forces (12,)."""
    a, b = np.zeros((13, 13)), np.zeros((13, 12))
    a[0:3, 6:9] = a[3:6, 9:12] = np.eye(3)
    a[11, 12] = -GRAVITY_M_S2
    for leg, arm in enumerate(arms):
        for axis, force in enumerate(np.eye(3)):
            b[6:9, 3 * leg + axis] = np.linalg.inv(BODY.inertia) @ np.cross(arm, force)
            b[9:12, 3 * leg + axis] = force / BODY.mass
    return a, b


def step_by_step(state: BodyState, forces: np.ndarray, feet: np.ndarray) -> list[np.ndarray]:
    """States (12,) after each step, by the exponential of the whole continuous system."""
    x = np.concatenate([*state, [1.0]])
    result = []
    for force, arms in zip(forces, feet, strict=True):
        a, b = system(arms)
        a[:, 12] += b @ force.ravel()
        x = expm(a * HORIZON.step_s) @ x
        result.append(x[:12])
    return result


class TestProblem:
    @pytest.mark.parametrize("seed", range(5))
    def test_the_condensed_cost_is_the_cost_of_the_simulated_states(self, seed: int) -> None:
        """Differences of cost between force plans agree with step-by-step integration."""
        situation = random_situation(seed)
        state, reference, contacts, feet, before = situation
        problem = PROBLEMS.build(*situation)
        n = len(problem.step)
        even = BODY.mass * GRAVITY_M_S2 / contacts.sum(axis=1)
        weights = np.concatenate([WEIGHTS.attitude, WEIGHTS.position, WEIGHTS.angular_rate, WEIGHTS.velocity])

        def cost(solution: np.ndarray) -> float:
            forces = np.zeros((HORIZON.steps, 4, 3))
            forces[problem.step, problem.leg] = solution.reshape(3, n).T[:, [1, 2, 0]]
            total = 0.0
            for step, x in enumerate(step_by_step(state, forces, feet)):
                desired = np.concatenate([part[step] for part in reference])
                total += 0.5 * float(weights @ (x - desired) ** 2)
                share = np.where(contacts[step], even[step], 0.0)
                total += (
                    0.5
                    * WEIGHTS.force
                    * float((forces[step][:, :2] ** 2).sum() + ((forces[step][:, 2] - share) ** 2).sum())
                )
                change = forces[step] - (forces[step - 1] if step else before)
                total += 0.5 * WEIGHTS.force_change * float((change**2).sum())
            return total

        def condensed(solution: np.ndarray) -> float:
            return float(0.5 * solution @ problem.hessian @ solution + problem.gradient @ solution)

        rng = np.random.default_rng(seed)
        plans = 50 * rng.standard_normal((3, 3 * n))
        for plan in plans[1:]:
            expected = cost(plan) - cost(plans[0])
            assert condensed(plan) - condensed(plans[0]) == pytest.approx(expected, rel=1e-6)

    def test_a_large_cost_of_changes_keeps_the_previous_forces(self) -> None:
        """Forces of feet that stand all the time do not change."""
        problems = ForceProblems(BODY, HORIZON, replace(WEIGHTS, force_change=1e6), CONTACT)
        situation = random_situation(3, standing=True)
        before = np.array([[3.0, -5.0, 60.0], [0.0, 0.0, 10.0], [1.0, 2.0, 30.0], [-8.0, 2.0, 40.0]])
        problem = problems.build(*situation[:4], before)
        solution = BoundedSolver().solve(problem)
        assert solution is not None
        np.testing.assert_allclose(problems.wrenches(solution, problem, 4).force, before, atol=1e-3)


class TestSolver:
    @pytest.mark.parametrize("seed", range(7))
    def test_the_fallback_agrees_with_daqp(self, seed: int) -> None:
        problem = PROBLEMS.build(*random_situation(seed, standing=seed % 2 == 0))
        late = BoundedSolver(daqp_iterations=0)
        fallback, exact = late.solve(problem), BoundedSolver(daqp_iterations=5000).solve(problem)
        assert late.fallbacks == 1
        assert fallback is not None
        assert exact is not None
        n = len(problem.step)
        now = problem.step == 0
        first = np.abs((fallback - exact).reshape(3, n)[:, now])
        assert first.max() < 1.0

    def test_a_problem_with_nan_has_no_solution_and_does_not_crash(self) -> None:
        problem = PROBLEMS.build(*random_situation(0))
        broken = problem._replace(gradient=np.full_like(problem.gradient, np.nan))
        assert BoundedSolver().solve(broken) is None

    def test_without_contacts_the_forces_are_zero(self) -> None:
        state, reference, contacts, feet, before = random_situation(0)
        problem = PROBLEMS.build(state, reference, np.zeros_like(contacts), feet, before)
        solution = BoundedSolver().solve(problem)
        assert solution is not None
        np.testing.assert_array_equal(PROBLEMS.wrenches(solution, problem, 4).force, 0)
