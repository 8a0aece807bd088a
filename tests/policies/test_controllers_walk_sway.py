"""Sway of a walking body, by hand: feet at the corners of a rectangle, one in the air at a time."""

import math

import numpy as np
import pytest

from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.walk.sway import Sway, SwayPlan, plan_sway, sine_at
from footfall.robots.support import support_margin

AHEAD, ASIDE = 0.2, 0.15
FEET = np.array([[AHEAD, ASIDE], [AHEAD, -ASIDE], [-AHEAD, ASIDE], [-AHEAD, -ASIDE]])  # FL FR HL HR
# Hind left in the air until 1/4, then front left, hind right, front right.
OFFSETS = np.array([0.5, 0.0, 0.75, 0.25])
HEIGHT_M = 0.2452  # w^2 h / g = 1 where w^2 = 40 / s^2
ONE_HZ = (2 * math.pi) ** 2 * HEIGHT_M / 9.81  # 0.987
DUTY = 0.75


def timing(period_s: float, duty: float = DUTY) -> GaitTiming:
    return GaitTiming(period_s, duty)


def test_the_body_sways_to_the_side_with_both_feet_down() -> None:
    """The middle of three corners is a third of the half width away, so the ideal sway is a square wave.

    The first sine of this sway has 4 / pi of the amplitude.
    """
    pressure = plan_sway(FEET, timing(1.0), OFFSETS, HEIGHT_M, 1.0).pressure
    amplitude = 4 / math.pi * ASIDE / 3
    np.testing.assert_allclose(sine_at(pressure, 0.25), [0.0, -amplitude], atol=1e-3)
    np.testing.assert_allclose(sine_at(pressure, 0.75), [0.0, amplitude], atol=1e-3)
    np.testing.assert_allclose(sine_at(pressure, np.array([0.0, 0.5])), 0.0, atol=1e-3)


@pytest.mark.parametrize(
    ("period_s", "part"), [(100.0, 1.0), (1.0, 1 / (1 + ONE_HZ)), (0.5, 1 / (1 + 4 * ONE_HZ))]
)
def test_the_body_moves_less_in_a_faster_gait(period_s: float, part: float) -> None:
    plan = plan_sway(FEET, timing(period_s), OFFSETS, HEIGHT_M, 1.0)
    np.testing.assert_allclose(plan.body, part * plan.pressure, rtol=2e-4)
    for share in (0.0, 0.5, 1.25):
        some = plan_sway(FEET, timing(period_s), OFFSETS, HEIGHT_M, share)
        np.testing.assert_allclose(some.body, share * plan.body, atol=1e-12)
    trot = np.array([0.5, 0.0, 0.0, 0.5])  # feet that alternate about the middle need no sway
    none = plan_sway(FEET, timing(period_s, 0.5), trot, HEIGHT_M, 1.0)
    np.testing.assert_allclose(none.body, 0.0, atol=1e-12)


def test_with_the_sway_the_weight_is_well_inside_the_three_feet_that_stand() -> None:
    """At 1/8 the hind left foot is in the air.

    The sway is 0.0637 sin 45 degrees = 0.045 m to the right; 0.8 of it is inside the support.
    """
    pressure = plan_sway(FEET, timing(2.0), OFFSETS, HEIGHT_M, 1.0).pressure
    three = [(x, y) for x, y in FEET[[0, 1, 3]].tolist()]
    assert support_margin(three, (0.0, 0.0)) == pytest.approx(0.0)
    x, y = sine_at(pressure, 0.125).tolist()
    assert support_margin(three, (x, y)) == pytest.approx(0.8 * 0.045, abs=1e-3)


def test_a_walk_begins_where_the_body_turns_back() -> None:
    """The body turns back on the right at 1/4, and on the left at 3/4, when the front foot lifts off."""
    plan = plan_sway(FEET, timing(1.0), OFFSETS, HEIGHT_M, 1.0)
    assert (plan.start(0.4) + 0.02) % 0.5 == pytest.approx(0.25, abs=3e-3)
    none = plan_sway(FEET, timing(1.0), OFFSETS, HEIGHT_M, 0.0)
    assert none.start(0.4) == 0.4


@pytest.mark.parametrize("phase", [0.8, -2.0])
def test_a_walk_begins_a_little_before_the_body_is_farthest_out(phase: float) -> None:
    """The larger sway, cos(2 pi t + phase) at clock t, is farthest out at t = -phase / (2 pi)."""
    body = np.array([0.01j, 0.05 * np.exp(1j * phase)])
    start = SwayPlan(body, body).start(0.4)
    assert start == pytest.approx((-phase / (2 * math.pi) - 0.02) % 1.0)
    before, at, after = (float(sine_at(body, start + 0.02 + d)[1]) for d in (-0.01, 0.0, 0.01))
    assert at == pytest.approx(0.05)
    assert max(before, after) < at


def test_in_flight_the_target_pressure_is_in_the_middle() -> None:
    """One foot at 0.1 m for a quarter of the cycle has the first sine 2 * 0.1 sin(pi / 4) / pi, at 1/8."""
    plan = plan_sway(np.array([[0.1, 0.0]]), timing(1.0, 0.25), np.zeros(1), HEIGHT_M, 1.0)
    amplitude = 0.2 * math.sin(math.pi / 4) / math.pi
    np.testing.assert_allclose(sine_at(plan.pressure, 0.125), [amplitude, 0.0], atol=1e-3)
    np.testing.assert_allclose(sine_at(plan.pressure, 0.375), 0.0, atol=1e-3)


class TestSway:
    GOAL = np.array([0.0, 0.05 + 0.0j])

    def test_the_sway_is_approached_within_a_quarter_cycle_without_a_jump(self) -> None:
        sway, way = Sway(), [0.0]
        for _ in range(250):
            sway.approach(self.GOAL, 0.001)
            way.append(float(sway.at(0.0)[1]))
        assert 0.045 < way[-1] < 0.05
        assert np.abs(np.diff(way, 2)).max() < 2e-5
        assert sway.distance(self.GOAL) == pytest.approx(0.05 - way[-1])

    @pytest.mark.parametrize("cycles", [1 / 16, 1.0])
    def test_a_long_tick_does_not_overshoot_the_sway(self, cycles: float) -> None:
        """Afterwards it equals the plan's sine at any time of the clock."""
        sway, goal = Sway(), np.array([0.03 + 0.02j, -0.01 + 0.04j])
        sway.approach(goal, cycles)
        assert sway.distance(goal) == pytest.approx(0.0, abs=1e-12)
        for clock in (0.0, 0.2, 0.7):
            np.testing.assert_allclose(sway.at(clock), sine_at(goal, clock), atol=1e-12)
        angle = 2 * math.pi * 0.2
        assert sway.at(0.2)[1] == pytest.approx(-0.01 * math.cos(angle) - 0.04 * math.sin(angle))

    def test_a_reset_sets_the_sway_to_zero(self) -> None:
        sway = Sway()
        sway.approach(self.GOAL, 0.1)
        sway.reset()
        assert sway.at(0.3) == (0.0, 0.0)
