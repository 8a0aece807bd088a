"""How the body of a walk sways, by hand: feet at the corners of a rectangle, one in the air at a time."""

import math

import numpy as np
import pytest

from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.walk.sway import Sway, plan_sway, sine_at
from footfall.robots.support import support_margin

AHEAD, ASIDE = 0.2, 0.15
PLACES = np.array([[AHEAD, ASIDE], [AHEAD, -ASIDE], [-AHEAD, ASIDE], [-AHEAD, -ASIDE]])  # FL FR HL HR
OFFSETS = np.array(
    [0.5, 0.0, 0.75, 0.25]
)  # hind left in the air until 1/4, then front left, hind right, front right
HEIGHT_M = 0.2452  # w^2 h / g = 1 where w^2 = 40 / s^2
ONE_HZ = (2 * math.pi) ** 2 * HEIGHT_M / 9.81  # 0.987
DUTY = 0.75


def timing(period_s: float, duty: float = DUTY) -> GaitTiming:
    return GaitTiming(period_s, duty)


def test_the_weight_goes_to_the_side_whose_feet_both_stand() -> None:
    """The middle of three corners is a third of its half away: a square wave. Its sine is 4 / pi of it."""
    pressure = plan_sway(PLACES, timing(1.0), OFFSETS, HEIGHT_M, 1.0).pressure
    most = 4 / math.pi * ASIDE / 3
    np.testing.assert_allclose(sine_at(pressure, 0.25), [0.0, -most], atol=1e-3)
    np.testing.assert_allclose(sine_at(pressure, 0.75), [0.0, most], atol=1e-3)
    np.testing.assert_allclose(sine_at(pressure, np.array([0.0, 0.5])), 0.0, atol=1e-3)


@pytest.mark.parametrize(
    ("period_s", "part"), [(100.0, 1.0), (1.0, 1 / (1 + ONE_HZ)), (0.5, 1 / (1 + 4 * ONE_HZ))]
)
def test_the_faster_the_gait_the_less_the_body_has_to_move(period_s: float, part: float) -> None:
    plan = plan_sway(PLACES, timing(period_s), OFFSETS, HEIGHT_M, 1.0)
    np.testing.assert_allclose(plan.body, part * plan.pressure, rtol=2e-4)


@pytest.mark.parametrize("share", [0.0, 0.5, 1.25])
def test_one_sways_by_a_share_of_it(share: float) -> None:
    whole = plan_sway(PLACES, timing(1.0), OFFSETS, HEIGHT_M, 1.0)
    some = plan_sway(PLACES, timing(1.0), OFFSETS, HEIGHT_M, share)
    np.testing.assert_allclose(some.body, share * whole.body, atol=1e-12)


def test_feet_that_alternate_about_the_middle_need_no_sway() -> None:
    trot = np.array([0.5, 0.0, 0.0, 0.5])
    np.testing.assert_allclose(plan_sway(PLACES, timing(1.0, 0.5), trot, HEIGHT_M, 1.0).body, 0.0, atol=1e-12)


def test_with_the_sway_the_weight_is_well_inside_the_three_feet_that_stand() -> None:
    """Hind left in the air at 1/8: 0.0637 sin 45 degrees = 0.045 m to the right, 0.8 of that inside."""
    pressure = plan_sway(PLACES, timing(2.0), OFFSETS, HEIGHT_M, 1.0).pressure
    three = [(x, y) for x, y in PLACES[[0, 1, 3]].tolist()]
    assert support_margin(three, (0.0, 0.0)) == pytest.approx(0.0)
    x, y = sine_at(pressure, 0.125).tolist()
    assert support_margin(three, (x, y)) == pytest.approx(0.8 * 0.045, abs=1e-3)


def test_a_walk_begins_where_the_body_turns_back() -> None:
    """To the right at 1/4, or to the left at 3/4; front left, or front right, lifts off then."""
    plan = plan_sway(PLACES, timing(1.0), OFFSETS, HEIGHT_M, 1.0)
    assert (plan.start(0.4) + 0.02) % 0.5 == pytest.approx(0.25, abs=3e-3)
    none = plan_sway(PLACES, timing(1.0), OFFSETS, HEIGHT_M, 0.0)
    assert none.start(0.4) == 0.4


class TestSway:
    GOAL = np.array([0.0, 0.05 + 0.0j])

    def test_it_is_there_after_a_quarter_of_a_cycle_without_a_jump(self) -> None:
        sway, way = Sway(), [0.0]
        for _ in range(250):
            sway.approach(self.GOAL, 0.001)
            way.append(float(sway.at(0.0)[1]))
        assert 0.045 < way[-1] < 0.05
        assert np.abs(np.diff(way, 2)).max() < 2e-5
        assert sway.misses(self.GOAL) == pytest.approx(0.05 - way[-1])

    def test_a_new_episode_has_none(self) -> None:
        sway = Sway()
        sway.approach(self.GOAL, 0.1)
        sway.reset()
        assert not sway.at(0.3).any()
