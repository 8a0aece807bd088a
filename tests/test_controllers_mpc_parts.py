"""The parts of the MPC, against brute force."""

import math

import daqp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from footfall.policies.controllers.mpc.config import Contact, FootholdConfig, Horizon, Weights
from footfall.policies.controllers.mpc.footholds import contact_points, footholds
from footfall.policies.controllers.mpc.problem import GRAVITY, BodyState, ForceProblem, ForceProblems
from footfall.policies.controllers.mpc.solver import BoundedSolver
from footfall.robots.description import load_robot
from footfall.robots.rigid_body import nominal_body

ROBOT = load_robot("go1")
BODY = nominal_body(ROBOT)
HORIZON = Horizon(steps=6, step_s=0.03, solve_hz=100.0)
WEIGHTS = Weights((9.0, 8.0, 7.0), (2.0, 3.0, 50.0), (0.1, 0.2, 0.3), (1.0, 1.5, 0.4), 1e-4)
CONTACT = Contact(friction=0.6, most_force_n=150.0)
PROBLEMS = ForceProblems(BODY, HORIZON, WEIGHTS, CONTACT)
PLACES = np.array([[0.19, -0.13, -0.25], [0.19, 0.13, -0.25], [-0.19, -0.13, -0.25], [-0.19, 0.13, -0.25]])


def random_situation(
    seed: int, standing: bool = False
) -> tuple[BodyState, BodyState, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    state = BodyState(*(0.3 * rng.standard_normal((4, 3))))
    reference = BodyState(*(0.1 * rng.standard_normal((4, HORIZON.steps, 3))))
    contacts = rng.uniform(size=(HORIZON.steps, 4)) < 0.6
    contacts[:, 0] = True
    if standing:
        contacts[:] = True
    feet = PLACES + 0.05 * rng.standard_normal((HORIZON.steps, 4, 3))
    return state, reference, contacts, feet


def step_by_step(state: BodyState, forces: np.ndarray, feet: np.ndarray) -> list[np.ndarray]:
    """States (12,) after each step, by the exponential series of the whole continuous system."""
    x = np.concatenate([*state, [1.0]])
    result = []
    for force, arms in zip(forces, feet, strict=True):
        system = np.zeros((13, 13))
        system[0:3, 6:9] = system[3:6, 9:12] = np.eye(3)
        system[6:9, 12] = np.linalg.inv(BODY.inertia) @ np.cross(arms, force).sum(axis=0)
        system[9:12, 12] = force.sum(axis=0) / BODY.mass - np.array([0, 0, GRAVITY])
        x = sum(
            (np.linalg.matrix_power(system * HORIZON.step_s, k) @ x / math.factorial(k) for k in range(9)),
            np.zeros(13),
        )
        result.append(x[:12])
    return result


class TestBody:
    def test_mass_centre_and_inertia_are_plausible(self) -> None:
        assert BODY.mass == pytest.approx(12.74, abs=0.01)
        assert abs(BODY.centre[2] + 0.021) < 0.003
        assert np.all(np.linalg.eigvalsh(BODY.inertia) > 0.05)
        assert np.all(np.linalg.eigvalsh(BODY.leg_inertia) > 0)


class TestProblem:
    @pytest.mark.parametrize("seed", range(5))
    def test_the_condensed_cost_is_the_cost_of_the_simulated_states(self, seed: int) -> None:
        """Up to a constant: differences of cost between force plans agree with step-by-step integration."""
        state, reference, contacts, feet = random_situation(seed)
        problem = PROBLEMS.build(state, reference, contacts, feet)
        n = len(problem.step)
        even = BODY.mass * GRAVITY / contacts.sum(axis=1)
        weights = np.concatenate([WEIGHTS.attitude, WEIGHTS.position, WEIGHTS.angular_rate, WEIGHTS.velocity])

        def cost(solution: np.ndarray) -> float:
            forces = np.zeros((HORIZON.steps, 4, 3))
            forces[problem.step, problem.leg] = solution.reshape(3, n).T[:, [1, 2, 0]]
            total = 0.0
            for step, x in enumerate(step_by_step(state, forces, feet)):
                wanted = np.concatenate([part[step] for part in reference])
                total += 0.5 * float(weights @ (x - wanted) ** 2)
                share = np.where(contacts[step], even[step], 0.0)
                total += (
                    0.5
                    * WEIGHTS.force
                    * float((forces[step][:, :2] ** 2).sum() + ((forces[step][:, 2] - share) ** 2).sum())
                )
            return total

        def condensed(solution: np.ndarray) -> float:
            return float(0.5 * solution @ problem.hessian @ solution + problem.gradient @ solution)

        rng = np.random.default_rng(seed)
        plans = 50 * rng.standard_normal((3, 3 * n))
        for plan in plans[1:]:
            expected = cost(plan) - cost(plans[0])
            assert condensed(plan) - condensed(plans[0]) == pytest.approx(expected, rel=1e-6)

    def test_it_holds_only_feet_that_stand(self) -> None:
        state, reference, contacts, feet = random_situation(1)
        problem = PROBLEMS.build(state, reference, contacts, feet)
        assert len(problem.step) == contacts.sum()
        assert np.all(contacts[problem.step, problem.leg])

    def test_standing_level_asks_for_the_weight(self) -> None:
        still = np.zeros(3)
        height = np.array([0.0, 0.0, 0.25])
        state = BodyState(still, height, still, still)
        reference = BodyState(*(np.tile(part, (HORIZON.steps, 1)) for part in state))
        contacts = np.ones((HORIZON.steps, 4), dtype=bool)
        feet = np.tile(PLACES, (HORIZON.steps, 1, 1))
        problem = PROBLEMS.build(state, reference, contacts, feet)
        solution = BoundedSolver().solve(problem)
        assert solution is not None
        forces = PROBLEMS.forces(solution, problem, 4)
        np.testing.assert_allclose(forces[:, 2], BODY.mass * GRAVITY / 4, rtol=1e-4)
        np.testing.assert_allclose(forces[:, :2], 0, atol=1e-3)


class TestSolver:
    @pytest.mark.parametrize("seed", range(8))
    def test_forces_stay_in_the_friction_pyramid(self, seed: int) -> None:
        problem = PROBLEMS.build(*random_situation(seed, standing=seed % 2 == 0))
        solution = BoundedSolver().solve(problem)
        assert solution is not None
        upward, x, y = solution.reshape(3, -1)
        assert np.all(upward >= -1e-4)
        assert np.all(upward <= CONTACT.most_force_n + 1e-4)
        assert np.all(np.abs(np.stack([x, y])) <= CONTACT.friction * upward + 1e-3)

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

    def test_a_problem_that_is_no_problem_gives_none_and_no_crash(self) -> None:
        problem = PROBLEMS.build(*random_situation(0))
        broken = problem._replace(gradient=np.full_like(problem.gradient, np.nan))
        assert BoundedSolver().solve(broken) is None

    def test_no_foot_on_the_ground_leaves_nothing_to_solve(self) -> None:
        state, reference, contacts, feet = random_situation(0)
        problem = PROBLEMS.build(state, reference, np.zeros_like(contacts), feet)
        solution = BoundedSolver().solve(problem)
        assert solution is not None
        np.testing.assert_array_equal(PROBLEMS.forces(solution, problem, 4), 0)


speeds = arrays(float, 3, elements=st.floats(-1.5, 1.5)).map(lambda v: v * np.array([1, 1, 0]))


def steps_for(velocity: np.ndarray, wanted: np.ndarray, yaw: float = 0.0, rate: float = 0.0) -> np.ndarray:
    return footholds(
        np.array([0.0, 0.0, 0.28]),
        velocity,
        wanted,
        yaw,
        rate,
        PLACES,
        np.zeros(4),
        0.2,
        FootholdConfig(capture_gain_s=0.05, most_step_m=0.3),
    )


class TestFootholds:
    def test_at_rest_feet_land_in_their_places(self) -> None:
        landing = steps_for(np.zeros(3), np.zeros(3))
        np.testing.assert_allclose(landing[:, :2], PLACES[:, :2])
        np.testing.assert_array_equal(landing[:, 2], 0.0)

    @given(speeds, speeds)
    def test_sideways_feedback_is_as_strong_as_forward_feedback(
        self, velocity: np.ndarray, wanted: np.ndarray
    ) -> None:
        turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
        step = steps_for(velocity, wanted) - PLACES
        sideways = steps_for(turned @ velocity, turned @ wanted) - PLACES
        np.testing.assert_allclose(sideways[:, :2], (step @ turned.T)[:, :2], atol=1e-12)

    @given(speeds, st.floats(-3, 3))
    def test_steps_turn_with_the_robot(self, velocity: np.ndarray, yaw: float) -> None:
        cos, sin = np.cos(yaw), np.sin(yaw)
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
        straight = steps_for(velocity, velocity, rate=0.5)
        turned = steps_for(turn @ velocity, turn @ velocity, yaw, rate=0.5)
        np.testing.assert_allclose(turned, straight @ turn.T, atol=1e-12)

    def test_a_push_is_caught_on_the_side_it_goes_to(self) -> None:
        step = steps_for(np.array([0.0, 0.6, 0.0]), np.zeros(3)) - PLACES
        assert np.all(step[:, 1] > 0.05)

    def test_steps_are_bounded(self) -> None:
        step = (steps_for(np.array([9.0, 9.0, 0.0]), np.zeros(3)) - PLACES)[:, :2]
        assert np.linalg.norm(step, axis=1).max() <= 0.3 + 1e-12


class TestContactPoints:
    def test_standing_swinging_and_later_feet(self) -> None:
        contacts = np.array([[1, 0], [1, 0], [0, 1], [1, 1]], dtype=bool)
        feet = np.array([[0.2, 0.1, 0.0], [0.2, -0.1, 0.0]])
        targets = feet + np.array([0.1, 0.0, 0.0])
        places = np.array([[0.19, 0.13, -0.3], [0.19, -0.13, -0.3]])
        centre = np.array([0.0, 0.0, 0.3]) + np.arange(4)[:, None] * np.array([0.02, 0.0, 0.0])
        arms = contact_points(contacts, feet, targets, places, centre, np.zeros(4))
        np.testing.assert_allclose(arms[0, 0], feet[0] - centre[0])
        np.testing.assert_allclose(arms[2, 1], targets[1] - centre[2])
        np.testing.assert_allclose(arms[3, 0], places[0])


def test_daqp_reports_success_as_a_positive_number() -> None:
    """What `BoundedSolver` relies on."""
    _, _, status, _ = daqp.solve(np.eye(2), np.ones(2), np.eye(2), np.ones(2), -np.ones(2))
    assert status > 0


def test_problem_fields_are_documented_sizes() -> None:
    problem: ForceProblem = PROBLEMS.build(*random_situation(3))
    n = len(problem.step)
    assert problem.hessian.shape == (3 * n, 3 * n)
    assert problem.rows.shape == (4 * n, 3 * n)
    assert problem.upper.shape == problem.lower.shape == (5 * n,)
