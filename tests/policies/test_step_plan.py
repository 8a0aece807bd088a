"""Footsteps of the capture point and the flight of a foot, against integrated pendulums and brute force."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize

from footfall.policies.controllers.step.footsteps import (
    NextStep,
    NominalStep,
    StepLimits,
    StepWeights,
    capture_after,
    next_step,
    nominal_step,
)
from footfall.policies.controllers.step.swing import Swing

RATE = 3.9  # 1/s, of a pendulum 0.645 m high
STEP_S, BOTH_S = 0.7, 0.15
LIMITS = StepLimits(
    ahead_m=(-0.3, 0.4), apart_m=(0.14, 0.35), time_s=(0.4, 0.9), min_swing_s=0.05, speed_m_s=1.5
)
WEIGHTS = StepWeights(place=1.0, time=0.02, offset=300.0)


def pendulum(capture: np.ndarray, last: np.ndarray, duration_s: float) -> np.ndarray:
    """The capture point relative to the new foot, by integration.

    The pressure moves there from the last foot.
    """

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        pressure = -last * max(0.0, 1.0 - t / BOTH_S)
        return RATE * (x - pressure)

    kwargs = {"rtol": 1e-10, "atol": 1e-12, "max_step": 0.01}
    return solve_ivp(rate, (0.0, duration_s), capture, **kwargs).y[:, -1]


def test_the_capture_point_under_a_moving_pressure() -> None:
    begin, last = np.array([0.05, -0.08]), np.array([0.2, 0.18])
    for time_s in (0.04, 0.15):
        ahead = capture_after(begin, -last, last / BOTH_S, time_s, RATE)
        np.testing.assert_allclose(ahead, pendulum(begin, last, time_s), atol=1e-8)


class TestNextStep:
    nominal = nominal_step(np.array([0.25, 0.05]), -1.0, 0.22, STEP_S, BOTH_S, RATE)

    # The capture point in the steady gait after 0.2 s, with the pressure under the middle of the foot.
    STEADY = (nominal.foothold + nominal.offset) * math.exp(-RATE * (STEP_S - 0.2))

    def decide(
        self, capture: np.ndarray, elapsed_s: float = 0.2, pressure: tuple[float, float] = (0.01, 0.0)
    ) -> NextStep:
        p = np.array(pressure)
        return next_step(capture, p, elapsed_s, 0.1, -1.0, RATE, self.nominal, LIMITS, WEIGHTS)

    def test_an_undisturbed_step_is_the_nominal_step(self) -> None:
        step = self.decide(self.STEADY, pressure=(0.0, 0.0))
        np.testing.assert_allclose(step.foothold, self.nominal.foothold, atol=1e-6)
        assert step.remaining_s == pytest.approx(STEP_S - 0.2, abs=1e-6)

    @pytest.mark.parametrize("push", [(0.03, 0.0), (-0.04, 0.01), (0.0, -0.02), (0.02, 0.015)])
    def test_a_disturbed_step_minimises_the_cost(self, push: tuple[float, float]) -> None:
        capture = self.STEADY + np.array(push)
        step = self.decide(capture)
        away = capture - np.array([0.01, 0.0])
        growth = math.exp(RATE * (STEP_S - 0.2))

        def cost(x: np.ndarray) -> float:
            offset = np.array([0.01, 0.0]) + away * x[2] - x[:2]
            # The next step begins with the pressure's motion from one foot to the other.
            begins = pendulum(offset, x[:2], BOTH_S) - pendulum(
                self.nominal.offset, self.nominal.foothold, BOTH_S
            )
            missed = begins * math.exp(-RATE * BOTH_S)
            return float(
                np.sum((x[:2] - self.nominal.foothold) ** 2)
                + 0.02 * (x[2] - growth) ** 2
                + 300.0 * np.sum(missed**2)
            )

        bounds = [(-0.3, 0.4), (-0.35, -0.14), (math.exp(RATE * 0.2), math.exp(RATE * 0.7))]
        best = minimize(cost, [*self.nominal.foothold, growth], bounds=bounds, tol=1e-14).x
        np.testing.assert_allclose(step.foothold, best[:2], atol=2e-4)
        assert step.remaining_s == pytest.approx(math.log(best[2]) / RATE, abs=1e-3)

    @pytest.mark.parametrize(("push", "left"), [(-0.3, -0.35), (0.3, -0.14)])
    def test_the_right_foot_lands_at_its_sideways_limits(self, push: float, left: float) -> None:
        assert self.decide(self.STEADY + np.array([0.0, push])).foothold[1] == pytest.approx(left)

    def test_nan_gives_the_nominal_step(self) -> None:
        step = self.decide(np.array([np.nan, 0.0]))
        assert isinstance(self.nominal, NominalStep)
        np.testing.assert_array_equal(step.foothold, self.nominal.foothold)
        assert step.remaining_s == pytest.approx(STEP_S - 0.2)
        assert self.decide(np.array([np.nan, 0.0]), elapsed_s=0.8).remaining_s == pytest.approx(0.1 / 1.5)


class TestSwing:
    def fly(self, goals: list[np.ndarray]) -> np.ndarray:
        """The reference at each tick, (ticks, 3, 4); a new goal for each equal part of 0.5 s."""
        swing, ticks = Swing(np.array([-0.1, 0.2]), 0.01, 0.3, lift_m=0.06, depth_m=0.005), 250
        return np.array(
            [swing.advance(goals[k * len(goals) // ticks], 0.5 - k * 0.002, 0.002) for k in range(ticks)]
        )

    def test_rates_are_derivatives_of_the_positions(self) -> None:
        flight = self.fly([np.array([0.25, 0.15, -0.2])])[20:200]
        slope = (flight[2:, 0] - flight[:-2, 0]) / 0.004
        np.testing.assert_allclose(slope, flight[1:-1, 1], atol=0.02)
        bend = (flight[2:, 1] - flight[:-2, 1]) / 0.004
        np.testing.assert_allclose(bend, flight[1:-1, 2], atol=0.35)

    def test_a_goal_that_moves_just_before_the_landing_is_not_followed(self) -> None:
        swing = Swing(np.array([0.25, 0.15]), 0.0, 0.0, lift_m=0.06, depth_m=0.005)
        moved = swing.advance(np.array([0.26, 0.15, 0.0]), 1e-4, 0.002)
        assert abs(moved[0, 0] - 0.25) < 0.01
        assert abs(moved[2, 0]) < 5000.0
