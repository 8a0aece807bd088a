"""The quadratic program of the MPC and its solvers, against brute force; moments and steps on soles."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.mpc.base import Base
from footfall.policies.controllers.mpc.catch import catching_foothold
from footfall.policies.controllers.mpc.config import CatchConfig, Contact, Horizon, Weights
from footfall.policies.controllers.mpc.problem import BodyState, ForceProblems
from footfall.policies.controllers.mpc.wrenches import Wrenches, sole_levers
from footfall.policies.controllers.solver import BoundedSolver
from footfall.robots.description import load_robot
from footfall.robots.rigid_body import nominal_body

BODY = nominal_body(load_robot("go1"))
HORIZON = Horizon(steps=6, step_s=0.03, solve_hz=100.0)
WEIGHTS = Weights((9.0, 8.0, 7.0), (2.0, 3.0, 50.0), (0.1, 0.2, 0.3), (1.0, 1.5, 0.4), 1e-4, 3e-4)
CONTACT = Contact(friction=0.6, max_force_n=150.0)
PROBLEMS = ForceProblems(BODY, HORIZON, WEIGHTS, CONTACT)
FEET = np.array([[0.19, -0.13, -0.25], [0.19, 0.13, -0.25], [-0.19, -0.13, -0.25], [-0.19, 0.13, -0.25]])
Situation = tuple[BodyState, BodyState, np.ndarray, np.ndarray, np.ndarray]


def random_situation(seed: int, standing: bool = False) -> Situation:
    """Inputs of a plan: state, reference, contacts, feet and the forces before."""
    rng = np.random.default_rng(seed)
    state = BodyState(*(0.3 * rng.standard_normal((2, 6))))
    reference = BodyState(*(0.1 * rng.standard_normal((2, HORIZON.steps, 6))))
    contacts = (rng.uniform(size=(HORIZON.steps, 4)) < 0.6) | standing
    contacts[:, 0] = True
    feet = FEET + 0.05 * rng.standard_normal((HORIZON.steps, 4, 3))
    return state, reference, contacts, feet, rng.uniform(-10.0, 60.0, (4, 3)) * [[1.0], [0.0], [1.0], [1.0]]


def step_by_step(state: BodyState, forces: np.ndarray, feet: np.ndarray) -> np.ndarray:
    """States (steps, 12) after each step, by the exponential of the whole continuous system.

    The system x' = A x has 12 states and a constant 1, by which gravity and the forces act.
    """
    x, result = np.array([*np.ravel(state), 1.0]), []
    for force, arms in zip(forces, feet, strict=True):
        a = np.zeros((13, 13))
        a[0:3, 6:9] = a[3:6, 9:12] = np.eye(3)
        a[6:9, 12] = np.linalg.solve(BODY.inertia, np.cross(arms, force).sum(axis=0))
        a[9:12, 12] = force.sum(axis=0) / BODY.mass - [0.0, 0.0, GRAVITY_M_S2]
        x = expm(a * HORIZON.step_s) @ x
        result.append(x[:12])
    return np.array(result)


@pytest.mark.parametrize("seed", range(5))
def test_the_condensed_cost_is_the_cost_of_the_simulated_states(seed: int) -> None:
    """Differences of cost between force plans agree with step-by-step integration."""
    situation = random_situation(seed)
    state, reference, contacts, feet, before = situation
    problem = PROBLEMS.build(*situation)
    n = len(problem.step)
    even = np.zeros((HORIZON.steps, 4, 3))  # each standing foot carries the same share of the weight
    even[:, :, 2] = contacts * (BODY.mass * GRAVITY_M_S2 / contacts.sum(axis=1))[:, None]
    weights = np.concatenate([WEIGHTS.attitude, WEIGHTS.position, WEIGHTS.angular_rate, WEIGHTS.velocity])

    def cost(solution: np.ndarray) -> float:
        forces = np.zeros((HORIZON.steps, 4, 3))
        forces[problem.step, problem.leg] = solution.reshape(3, n).T[:, [1, 2, 0]]
        errors = step_by_step(state, forces, feet) - np.hstack(reference)
        changes = np.diff(forces, axis=0, prepend=before[None])
        total = (weights * errors**2).sum() + WEIGHTS.force * ((forces - even) ** 2).sum()
        return 0.5 * float(total + WEIGHTS.force_change * (changes**2).sum())

    def condensed(solution: np.ndarray) -> float:
        return float(0.5 * solution @ problem.hessian @ solution + problem.gradient @ solution)

    first, *others = 50 * np.random.default_rng(seed).standard_normal((3, 3 * n))
    for plan in others:
        assert condensed(plan) - condensed(first) == pytest.approx(cost(plan) - cost(first), rel=1e-6)


def test_a_large_cost_of_changes_keeps_the_previous_forces() -> None:
    """Forces of feet that stand all the time do not change."""
    problems = ForceProblems(BODY, HORIZON, replace(WEIGHTS, force_change=1e6), CONTACT)
    before = np.array([[3.0, -5.0, 60.0], [0.0, 0.0, 10.0], [1.0, 2.0, 30.0], [-8.0, 2.0, 40.0]])
    problem = problems.build(*random_situation(3, standing=True)[:4], before)
    solution = BoundedSolver().solve(problem)
    assert solution is not None
    np.testing.assert_allclose(problems.wrenches(solution, problem, 4).force, before, atol=1e-3)


@pytest.mark.parametrize("seed", range(7))
def test_the_fallback_agrees_with_daqp(seed: int) -> None:
    problem = PROBLEMS.build(*random_situation(seed, standing=seed % 2 == 0))
    late = BoundedSolver(daqp_iterations=0)
    fallback, exact = late.solve(problem), BoundedSolver(daqp_iterations=5000).solve(problem)
    assert late.fallbacks == 1
    assert fallback is not None
    assert exact is not None
    assert np.abs((fallback - exact).reshape(3, -1)[:, problem.step == 0]).max() < 1.0


def test_a_problem_with_nan_has_no_solution_and_does_not_crash() -> None:
    problem = PROBLEMS.build(*random_situation(0))
    assert BoundedSolver().solve(problem._replace(gradient=np.nan * problem.gradient)) is None


def test_without_contacts_the_forces_are_zero() -> None:
    state, reference, contacts, *others = random_situation(0)
    problem = PROBLEMS.build(state, reference, np.zeros_like(contacts), *others)
    solution = BoundedSolver().solve(problem)
    assert solution is not None
    np.testing.assert_array_equal(PROBLEMS.wrenches(solution, problem, 4).force, 0)


G1 = load_robot("g1")
LEVERS, HEIGHT = sole_levers(G1, 1.0), 0.65


def planned(lean_m: float, friction: float = 0.5) -> Wrenches:
    """The plan of a body that stands on its left foot with its centre ahead of the sole's middle."""
    horizon = Horizon(steps=5, step_s=0.03, solve_hz=100.0)
    weights = Weights((500.0,) * 3, (20.0,) * 3, (5.0,) * 3, (20.0,) * 3, 1e-5, moment=1e-3)
    problems = ForceProblems(nominal_body(G1), horizon, weights, Contact(friction, 900.0), LEVERS)
    state = BodyState(np.array([0.0, 0.0, 0.1, lean_m, 0.0, HEIGHT]), np.zeros(6))
    reference = BodyState(np.tile([0.0, 0.0, 0.0, lean_m, 0.0, HEIGHT], (5, 1)), np.zeros((5, 6)))
    contacts, feet = np.tile([True, False], (5, 1)), np.tile([-lean_m, 0.0, -HEIGHT], (5, 2, 1))
    problem = problems.build(state, reference, contacts, feet, np.zeros((2, 3)))
    solution = BoundedSolver().solve(problem)
    assert solution is not None
    return problems.wrenches(solution, problem, 2)


def test_the_centre_of_pressure_follows_the_body_as_far_as_the_sole_reaches() -> None:
    """The sole is 0.17 m long."""
    assert 0.005 < planned(0.03).pressure(0).real < 0.03
    for lean_m, end_m in ((0.5, 0.085), (-0.5, -0.085)):
        assert planned(lean_m).pressure(0).real == pytest.approx(end_m, abs=1e-6)


def test_friction_bounds_the_moment_about_the_vertical() -> None:
    """The body must turn back by 0.1 rad."""
    firm, slippery = planned(0.0), planned(0.0, friction=0.01)
    limit = 0.01 * LEVERS[0, 2] * slippery.force[0, 2]
    assert -slippery.moment[0, 2] == pytest.approx(limit)
    assert -firm.moment[0, 2] > 2 * limit


def pendulum_walk(desired: complex, velocity: complex, steps: int) -> tuple[list[complex], complex]:
    """Positions of the feet that catch a pendulum, and its mean velocity in the last two steps."""
    timing, config = GaitTiming(0.8, 0.6), CatchConfig(0.2, (-1.0, 1.0), (0.05, 1.0))
    rate, dt_s, swing_s, both_s = math.sqrt(9.81 / HEIGHT), 0.002, 0.32, 0.08
    position, feet, began = 0j, [0.1j, -0.1j], []
    for step in range(steps):
        began.append(position)
        side, (old, stand), target = 1.0 - 2.0 * (step % 2), feet[-2:], 0j
        for tick in range(round((swing_s + both_s) / dt_s)):
            time_s, away = tick * dt_s, stand - position
            if time_s >= both_s:
                motion = np.array([velocity.real, velocity.imag, 0.0])
                base = Base(position, HEIGHT, motion, np.eye(3), np.zeros(3), 0.0, 0.0, 0.0)
                foot, left_s = np.array([away.real, away.imag, -HEIGHT]), both_s + swing_s - time_s
                goal = side, desired, 0.0, left_s, timing, config
                target = catching_foothold(base, np.zeros(3), foot, 0j, *goal)
            pressure = old + (stand - old) * min(1.0, time_s / both_s)
            velocity += rate**2 * (position - pressure) * dt_s
            position += velocity * dt_s
        feet.append(target)
    return feet, (position - began[-2]) / (2 * (swing_s + both_s))


@pytest.mark.parametrize("velocity", [0j, 0.3 + 0.1j])
def test_steps_catch_the_body_and_become_those_of_the_steady_gait(velocity: complex) -> None:
    feet, mean = pendulum_walk(0.4 + 0.05j, velocity, 10)
    assert mean == pytest.approx(0.4 + 0.05j, abs=0.02)
    np.testing.assert_allclose(np.abs(np.diff(feet[-3:]).imag).mean(), 0.2, atol=0.02)
