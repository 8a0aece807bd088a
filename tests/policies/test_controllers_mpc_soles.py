"""Model-predictive control on soles: moments, footholds that catch a falling body, and a biped that walks."""

import math

import numpy as np
import pytest

from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.mpc.base import Base
from footfall.policies.controllers.mpc.catch import catching_foothold
from footfall.policies.controllers.mpc.config import CatchConfig, Contact, Horizon, Weights
from footfall.policies.controllers.mpc.problem import BodyState, ForceProblems
from footfall.policies.controllers.mpc.wrenches import Wrenches, sole_levers
from footfall.policies.controllers.solver import BoundedSolver
from footfall.robots.description import load_robot
from footfall.robots.rigid_body import nominal_body

G1, BODY = load_robot("g1"), nominal_body(load_robot("g1"))
LEVERS = sole_levers(G1, 1.0)
HEIGHT = 0.65


def planned(lean_m: float, friction: float = 0.5) -> Wrenches:
    """The plan of a body that stands on its left foot with its centre ahead of the sole's middle."""
    horizon = Horizon(steps=5, step_s=0.03, solve_hz=100.0)
    weights = Weights((500.0,) * 3, (20.0,) * 3, (5.0,) * 3, (20.0,) * 3, 1e-5, moment=1e-3)
    problems = ForceProblems(BODY, horizon, weights, Contact(friction, 900.0), LEVERS)
    state = BodyState(np.array([0.0, 0.0, 0.1, lean_m, 0.0, HEIGHT]), np.zeros(6))
    reference = BodyState(np.zeros((5, 6)), np.zeros((5, 6)))
    reference.pose[:, 3:] = lean_m, 0.0, HEIGHT
    contacts, feet = np.zeros((5, 2), dtype=bool), np.zeros((5, 2, 3))
    contacts[:, 0], feet[:, :, 0], feet[:, :, 2] = True, -lean_m, -HEIGHT
    problem = problems.build(state, reference, contacts, feet, np.zeros((2, 3)))
    solution = BoundedSolver().solve(problem)
    assert solution is not None
    return problems.wrenches(solution, problem, 2)


class TestMoments:
    def test_the_centre_of_pressure_follows_the_body_as_far_as_the_sole_reaches(self) -> None:
        """The sole is 0.17 m long."""
        assert 0.005 < planned(0.03).pressure(0).real < 0.03
        assert planned(0.5).pressure(0).real == pytest.approx(0.085, abs=1e-6)
        assert planned(-0.5).pressure(0).real == pytest.approx(-0.085, abs=1e-6)

    def test_friction_bounds_the_moment_about_the_vertical(self) -> None:
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
        side, stand, old = (1.0, feet[-1], feet[-2]) if step % 2 == 0 else (-1.0, feet[-1], feet[-2])
        target = 0j
        for tick in range(round((swing_s + both_s) / dt_s)):
            time_s = tick * dt_s
            pressure = stand if time_s >= both_s else old + (stand - old) * time_s / both_s
            if time_s >= both_s:
                motion = np.array([velocity.real, velocity.imag, 0.0])
                base = Base(position, HEIGHT, motion, np.eye(3), np.zeros(3), 0.0, 0.0, 0.0)
                away = np.array([(stand - position).real, (stand - position).imag, -HEIGHT])
                left_s = both_s + swing_s - time_s
                target = catching_foothold(
                    base, np.zeros(3), away, 0j, side, desired, 0.0, left_s, timing, config
                )
            velocity += rate**2 * (position - pressure) * dt_s
            position += velocity * dt_s
        feet.append(target)
    return feet, (position - began[-2]) / (2 * (swing_s + both_s))


@pytest.mark.parametrize("velocity", [0j, 0.3 + 0.1j])
def test_steps_catch_the_body_and_become_those_of_the_steady_gait(velocity: complex) -> None:
    feet, mean = pendulum_walk(0.4 + 0.05j, velocity, 10)
    assert mean == pytest.approx(0.4 + 0.05j, abs=0.02)
    widths = np.abs(np.diff(np.array(feet)[-3:]).imag)
    np.testing.assert_allclose(widths.mean(), 0.2, atol=0.02)
