"""Clock, schedule and swing curves."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from footfall.policies.controllers.command import CommandShaping, ShapedCommand
from footfall.policies.controllers.gait import (
    GaitTiming,
    StepClock,
    contact_trust,
    in_stance,
    leg_phases,
    swing_curve,
    swing_progress,
)

TROT = np.array([0.0, 0.5, 0.5, 0.0])
WAVE = np.arange(6) / 6


class TestSchedule:
    def test_a_trot_of_duty_one_half_always_has_one_diagonal_down(self) -> None:
        for clock in np.linspace(0, 0.999, 57):
            stands = in_stance(leg_phases(clock, TROT), 0.5)
            assert stands.sum() == 2
            assert stands[0] == stands[3]

    @given(st.floats(0.0, 0.999), st.floats(0.2, 0.9))
    def test_a_foot_swings_exactly_when_it_does_not_stand(self, clock: float, duty: float) -> None:
        phases = leg_phases(clock, WAVE)
        progress = swing_progress(phases, duty)
        assert np.all((progress > 0) <= ~in_stance(phases, duty))
        assert np.all((progress >= 0) & (progress <= 1))

    def test_trust_is_full_in_mid_stance_and_none_at_the_edges_and_in_swing(self) -> None:
        trust = contact_trust(np.array([0.0, 0.25, 0.5, 0.8]), duty=0.5, edge=0.2)
        np.testing.assert_allclose(trust, [0, 1, 0, 0])


class TestSwingCurve:
    @given(s=st.floats(0.001, 0.999))
    def test_slope_and_bend_are_the_derivatives(self, s: float) -> None:
        step = 1e-5
        for before, now, after in zip(*(swing_curve(s + d) for d in (-step, 0.0, step)), strict=True):
            assert now.slope == pytest.approx((after.value - before.value) / (2 * step), abs=1e-6)
            assert now.bend == pytest.approx((after.slope - before.slope) / (2 * step), abs=1e-4)

    @pytest.mark.parametrize(("s", "along", "height"), [(0.0, 0.0, 0.0), (0.5, 0.5, 1.0), (1.0, 1.0, 0.0)])
    def test_it_goes_from_lift_off_over_its_top_to_touch_down(
        self, s: float, along: float, height: float
    ) -> None:
        curve = swing_curve(s)
        assert curve.along.value == pytest.approx(along, abs=1e-12)
        assert curve.height.value == pytest.approx(height, abs=1e-12)
        assert curve.height.slope == pytest.approx(0.0, abs=1e-12)

    @pytest.mark.parametrize("end", [0.0, 1.0])
    def test_it_is_at_rest_at_both_ends(self, end: float) -> None:
        assert swing_curve(end).along.slope == pytest.approx(0.0, abs=1e-12)


class TestClock:
    @pytest.mark.parametrize(
        ("offsets", "duty", "left_s"),
        [
            (TROT, 0.5, 0.102),  # 0.148 s into a period of 0.5 s: the second diagonal lands at 0.25 s
            (TROT, 0.65, 0.102),
            (WAVE, 5 / 6, 0.0187),  # the swing of the leg that lands at a third of the period
        ],
    )
    def test_it_stops_when_the_swings_that_have_begun_are_over(
        self, offsets: np.ndarray, duty: float, left_s: float
    ) -> None:
        clock = StepClock(GaitTiming(period_s=0.5, duty=duty), offsets)
        for _ in range(37):
            clock.advance(0.004, walk=True)
        assert not clock.stance().all()
        ticks = 0
        while clock.walking:
            clock.advance(0.004, walk=False)
            ticks += 1
        assert ticks == math.ceil(left_s / 0.004)
        assert clock.stance().all()

    def test_a_resting_clock_plans_to_stand(self) -> None:
        clock = StepClock(GaitTiming(0.4, 0.5), TROT)
        clock.advance(1.0, walk=False)
        assert clock.planned_stance(np.linspace(0, 1, 5)).all()
        assert not clock.swing().any()

    def test_the_plan_is_what_then_happens(self) -> None:
        clock = StepClock(GaitTiming(0.4, 0.6), TROT)
        clock.advance(0.01, walk=True)
        plan = clock.planned_stance(np.array([0.05, 0.15, 0.25]))
        for row, ahead in zip(plan, (0.05, 0.1, 0.1), strict=True):
            clock.advance(ahead, walk=True)
            np.testing.assert_array_equal(clock.stance(), row)


class TestCommand:
    SHAPING = CommandShaping(2.0, 5.0, 0.1)

    def test_it_approaches_at_the_bounded_rate(self) -> None:
        command = ShapedCommand(self.SHAPING)
        command.advance(np.array([1.0, 0.01, 1.0]), 0.1)
        np.testing.assert_allclose(command.value, [0.2, 0.01, 0.5])

    def test_a_small_command_means_stand_but_only_after_slowing_down(self) -> None:
        command, small = ShapedCommand(self.SHAPING), np.array([0.05, 0.0, 0.0])
        command.advance(np.array([0.4, 0.0, 0.0]), 1.0)
        assert command.wants_walk(small)
        command.advance(small, 1.0)
        assert not command.wants_walk(small)

    @pytest.mark.parametrize(("asked", "followed"), [(0.09, 0.0), (0.11, 0.11), (-0.11, -0.11)])
    def test_a_command_counts_from_the_norm_on_that_means_stand(self, asked: float, followed: float) -> None:
        command = ShapedCommand(self.SHAPING)
        command.advance(np.array([0.0, asked, 0.0]), 1.0)
        np.testing.assert_allclose(command.value, [0.0, followed, 0.0])

    def test_a_new_episode_begins_at_rest(self) -> None:
        command = ShapedCommand(self.SHAPING)
        command.advance(np.array([1.0, 0.0, 1.0]), 1.0)
        command.reset()
        np.testing.assert_array_equal(command.value, 0.0)
