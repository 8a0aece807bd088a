"""Clock, schedule and swing curves."""

import math

import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.policies.controllers.gait import (
    GaitConfig,
    GaitTiming,
    StepClock,
    contact_trust,
    in_stance,
    leg_phases,
    swing_curve,
    swing_progress,
)
from footfall.robots.description import Robot

TROT = np.array([0.0, 0.5, 0.5, 0.0])
WAVE = np.arange(6) / 6


class TestSchedule:
    def test_trust_rises_and_falls_over_the_edges_of_the_stance(self) -> None:
        """A tenth of a stance of 0.8 cycles is 0.08 cycles, so trust is one half after 0.04."""
        trust = contact_trust(np.array([0.02, 0.04, 0.08, 0.72, 0.76, 0.78]), duty=0.8, edge=0.1)
        np.testing.assert_allclose(trust, [0.25, 0.5, 1.0, 1.0, 0.5, 0.25])
        trust = contact_trust(np.array([0.0, 0.25, 0.5, 0.8]), duty=0.5, edge=0.2)
        np.testing.assert_allclose(trust, [0, 1, 0, 0])

    def test_a_foot_lifts_off_at_its_duty_and_swings_for_the_rest(self) -> None:
        phases = np.array([0.0, 0.599, 0.6, 0.7, 0.999])
        assert in_stance(phases, 0.6).tolist() == [True, True, False, False, False]
        np.testing.assert_allclose(swing_progress(phases, 0.6), [0.0, 0.0, 0.0, 0.25, 0.9975])
        np.testing.assert_allclose(leg_phases(0.3, np.array([0.0, 0.2, 0.9])), [0.3, 0.5, 0.2])
        timing = GaitTiming(period_s=0.4, duty=0.7)
        assert (timing.stance_s, timing.swing_s) == pytest.approx((0.28, 0.12))


class TestNamedGait:
    def test_a_clock_has_the_gaits_feet_and_duty_unless_another_duty_is_given(self, go1: Robot) -> None:
        clock = GaitConfig("walk", 0.9).clock(go1)
        assert (clock.timing.period_s, clock.timing.duty) == (0.9, 0.75)
        assert clock.offsets.tolist() == [0.0, 0.5, 0.25, 0.75]
        assert GaitConfig("walk", 0.9, duty=0.8).clock(go1).timing.duty == 0.8
        with pytest.raises(UserError, match="'tripod'"):
            GaitConfig("tripod", 0.9).clock(go1)

    def test_a_gait_that_never_ends_or_never_steps_is_refused(self) -> None:
        for period_s, duty, named in (
            (0.0, 0.5, "period_s"),
            (-1.0, 0.5, "period_s"),
            (0.5, 0.0, "duty"),
            (0.5, 1.0, "duty"),
        ):
            with pytest.raises(ValueError, match=named):
                GaitTiming(period_s, duty)
            with pytest.raises(ValueError, match=named):
                GaitConfig("walk", period_s, duty)


class TestSwingCurve:
    @pytest.mark.parametrize(("s", "along", "height"), [(0.0, 0.0, 0.0), (0.5, 0.5, 1.0), (1.0, 1.0, 0.0)])
    def test_a_swing_moves_from_lift_off_to_touch_down(self, s: float, along: float, height: float) -> None:
        curve = swing_curve(s)
        assert curve.along.value == pytest.approx(along, abs=1e-12)
        assert curve.height.value == pytest.approx(height, abs=1e-12)
        assert curve.height.slope == pytest.approx(0.0, abs=1e-12)


class TestClock:
    def test_a_clock_stops_when_swings_are_over(self) -> None:
        for offsets, duty, left_s in (
            (TROT, 0.5, 0.102),  # 0.148 s into a period of 0.5 s: the second diagonal lands at 0.25 s
            (TROT, 0.65, 0.102),
            (WAVE, 5 / 6, 0.0187),  # the swing of the leg that lands at a third of the period
        ):
            clock = StepClock(GaitTiming(period_s=0.5, duty=duty), offsets)
            for _ in range(37):
                clock.advance(0.004, walk=True)
            assert not clock.stance().all()
            ticks = 0
            while clock.walking:
                clock.advance(0.004, walk=False)
                ticks += 1
                assert ticks < 1000
            assert ticks == math.ceil(left_s / 0.004)
            assert clock.stance().all()

    def test_a_resting_clock_plans_to_stand(self) -> None:
        clock = StepClock(GaitTiming(0.4, 0.4), TROT)  # feet of phase 0.5 would be in the air
        clock.advance(1.0, walk=False)
        assert clock.planned_stance(np.linspace(0, 1, 5)).tolist() == [[True] * 4] * 5
        assert not clock.swing().any()

    def test_a_clock_with_a_lead_announces_its_first_swings_and_keeps_the_feet_down_until_then(self) -> None:
        clock = StepClock(GaitTiming(0.4, 0.4), TROT, lead_s=0.2)  # feet of phase 0.5 are in the air at once
        clock.advance(0.05, walk=True)
        assert clock.stance().all()
        assert clock.planned_stance(np.array([0.1, 0.16])).all(axis=1).tolist() == [True, False]
        clock.advance(0.16, walk=True)
        assert clock.stance().sum() == 2

    @pytest.mark.parametrize("begun_s", [0.0, 0.06, 0.17, 0.3])
    def test_the_clock_follows_its_own_plan(self, begun_s: float) -> None:
        clock = StepClock(GaitTiming(0.4, 0.6), TROT)
        clock.advance(begun_s, walk=True)
        clock.advance(0.01, walk=True)
        plan = clock.planned_stance(np.array([0.05, 0.15, 0.25]))
        for row, ahead in zip(plan, (0.05, 0.1, 0.1), strict=True):
            clock.advance(ahead, walk=True)
            np.testing.assert_array_equal(clock.stance(), row)
