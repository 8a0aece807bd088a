"""Feet and limits of the gait generator at single times, calculated by hand."""

from typing import ClassVar

import numpy as np
import pytest

from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.walk.config import LimitsConfig
from footfall.policies.controllers.walk.feet import FootCycle, stances, steady_cycle
from footfall.policies.controllers.walk.foot import Foot, Footing, blend, lift
from footfall.policies.controllers.walk.limits import SteadyWalk, WalkLimits
from footfall.policies.controllers.walk.sway import SwayPlan
from footfall.robots.description import load_robot

TIMING = GaitTiming(period_s=2.0, duty=0.6)  # stands for 1.2 s, swings for 0.8 s
FEET = np.array([[0.3, 0.2, 0.0], [-0.2, -0.1, 0.0]])
OFFSETS = np.array([0.0, 0.5])
FOOTING = Footing(FEET, np.tile(np.eye(2), (2, 1, 1)))  # of points, which do not roll
BOTH = (True, True)
REST = [0.0, 0.0, 0.0]
VELOCITY = np.array([0.1, -0.05, 0.2])
PASSING = np.array([[0.1 - 0.04, -0.05 + 0.06, 0.0], [0.1 + 0.02, -0.05 - 0.04, 0.0]])  # v + w x r


def test_a_blend_is_at_rest_at_both_ends_and_a_lift_as_well() -> None:
    np.testing.assert_allclose(blend(np.array([0.0, 0.2, 0.5, 0.8, 1.0])), [0, 0.05792, 0.5, 0.94208, 1])
    lifted = [lift(s) for s in (0.0, 0.25, 0.5, 0.75, 1.0)]
    np.testing.assert_allclose(lifted, [0, 0.5, 1, 0.5, 0], atol=1e-15)


def test_a_steady_stance_moves_backward_with_the_ground() -> None:
    """At clock 0.15 the first foot has completed a quarter of its stance; the other is in the air."""
    (first, second) = stances(FOOTING, TIMING, OFFSETS, VELOCITY, np.array([0.15, 0.55]))
    np.testing.assert_allclose(first, (FEET + 0.25 * 1.2 * PASSING)[:1, :2])
    through = (0.55 / 0.6, 0.05 / 0.6)
    expected = [FEET[k] + (0.5 - through[k]) * 1.2 * PASSING[k] for k in range(2)]
    np.testing.assert_allclose(second, np.array(expected)[:, :2])


def lift_feet(cycle: FootCycle, *feet: int) -> None:
    for foot in feet:
        cycle.each_foot[foot].lift_off(0.03)


class TestRolling:
    def test_a_stance_is_symmetric_about_the_foots_position_for_any_rolling(self) -> None:
        askew = Footing(FEET, np.tile(np.array([[0.9, 0.1], [0.2, 0.8]]), (2, 1, 1)))
        forward = np.array([0.1, 0.0, 0.0])
        ends = steady_cycle(askew, TIMING, forward, 0.0, np.array([0.0, 1.0]))
        np.testing.assert_allclose(ends.mean(axis=0), FEET, atol=1e-12)
        np.testing.assert_allclose((ends[1] - ends[0])[:, :2], np.tile([0.9 * 0.12, 0.2 * 0.12], (2, 1)))

    def test_a_rolling_foot_moves_at_its_share_of_v_plus_w_x_r(self) -> None:
        half = Footing(FEET, np.tile(0.5 * np.eye(2), (2, 1, 1)))
        np.testing.assert_allclose(half.passing_velocity(VELOCITY, FEET[:, :2]), 0.5 * PASSING[:, :2])


class TestFoot:
    """One rolling foot under a body that moves ahead and to the right, and turns left."""

    ROLLING: ClassVar = [[0.9, 0.05], [-0.02, 0.8]]
    HERE = np.array([0.25, 0.23])

    @pytest.fixture
    def foot(self) -> Foot:
        foot = Foot([0.3, 0.2], self.ROLLING)
        foot.x, foot.y, foot.z = *self.HERE.tolist(), 0.01
        return foot

    def passing(self, point: np.ndarray) -> np.ndarray:
        return np.array(self.ROLLING) @ (VELOCITY[:2] + np.cross([0.0, 0.0, 0.2], [*point, 0.0])[:2])

    def test_a_swinging_foot_is_between_two_points_that_move_with_the_ground(self, foot: Foot) -> None:
        """At three quarters of the swing the blend is 459 / 512, the lift is half, and 0.2 s are left."""
        foot.lift_off(0.04)
        foot.fly(VELOCITY.tolist(), 0.5, 0.75, TIMING)
        left = self.HERE - 0.5 * self.passing(self.HERE)
        nominal = np.array([0.3, 0.2])
        stance = nominal + 0.6 * self.passing(nominal)
        share = 459 / 512
        way = stance + 0.2 * self.passing(stance) - left
        assert (foot.x, foot.y) == pytest.approx(tuple(left + share * way))
        assert foot.z == pytest.approx((1 - share) * 0.01 + 0.5 * 0.04)
        assert foot.progress == 0.75
        foot.fly(VELOCITY.tolist(), 0.1, 1.0, TIMING)
        assert (foot.x, foot.y, foot.z) == pytest.approx((*stance, 0.0))


class TestCycle:
    @pytest.fixture
    def cycle(self) -> FootCycle:
        return FootCycle(FOOTING, TIMING, OFFSETS)

    def test_a_foot_lifts_off_at_its_duty_and_lands_at_the_cycles_end(self, cycle: FootCycle) -> None:
        cycle.advance(REST, 1.19, 0.04, BOTH)
        assert cycle.swings.tolist() == [False, False]
        cycle.advance(REST, 0.41, 0.04, BOTH)
        assert cycle.swings.tolist() == [True, False]
        np.testing.assert_allclose(cycle.progress, [0.5, 0.0])
        np.testing.assert_allclose(cycle.feet, FEET + np.outer([1.0, 0.0], [0.0, 0.0, 0.04]), atol=1e-9)
        cycle.advance(REST, 0.41, 0.04, BOTH)
        assert cycle.swings.tolist() == [False, False]
        assert cycle.progress.tolist() == [0.0, 0.0]
        np.testing.assert_allclose(cycle.feet, FEET, atol=1e-12)

    def test_after_a_reset_all_feet_are_at_their_nominal_positions(self, cycle: FootCycle) -> None:
        for _ in range(14):
            cycle.advance(VELOCITY.tolist(), 0.1, 0.04, BOTH)
        assert cycle.swings.any()
        cycle.reset()
        assert (cycle.clock, cycle.swings.any(), cycle.progress.any()) == (0.0, False, False)
        np.testing.assert_array_equal(cycle.feet, FEET)

    @pytest.mark.parametrize("seed", range(20))
    def test_a_new_gait_begins_with_the_smallest_travel(self, cycle: FootCycle, seed: int) -> None:
        """All 24 clocks are tried. The body's rotation counts in the past, not in the future."""
        rng = np.random.default_rng(seed)
        timing, offsets = GaitTiming(float(rng.uniform(0.3, 3.0)), 0.6), rng.uniform(size=2)
        velocity = [*rng.uniform(-0.2, 0.2, 2).tolist(), float(rng.uniform(-2.0, 2.0))]
        for foot in cycle.each_foot:
            foot.x += float(rng.uniform(-0.1, 0.1))
        worst = []
        for clock in np.arange(24) / 24:
            waits_s = (0.6 - clock - offsets) % 1.0 * timing.period_s
            travel = [foot.travel(velocity) for foot in cycle.each_foot]
            worst.append(max(np.array(travel) + np.hypot(*velocity[:2]) * waits_s))
        cycle.change_gait(timing, offsets, velocity)
        assert cycle.clock == np.argmin(worst) / 24

    def test_only_standing_feet_are_lowered_and_only_to_the_limit(self, cycle: FootCycle) -> None:
        cycle.lower([True, False], 0.004, -0.01)
        np.testing.assert_allclose(cycle.feet[:, 2], [-0.004, 0.0])
        for _ in range(3):
            cycle.lower([True, False], 0.004, -0.01)
        np.testing.assert_allclose(cycle.feet[:, 2], [-0.01, 0.0])
        lift_feet(cycle, 1)
        cycle.lower([True, True], 0.004, -0.01)
        np.testing.assert_allclose(cycle.feet[:, 2], [-0.01, 0.0])
        cycle.lower([True, True], 0.004, -0.002)  # no foot is raised to a higher bound
        np.testing.assert_allclose(cycle.feet[:, 2], [-0.01, 0.0])

    @pytest.mark.parametrize(
        ("above_m", "stands_m"),
        [(0.012, 0.012), (0.0, 0.0), (-0.01, 0.0), (0.1, 0.03)],  # a swing of 3 cm meets no ground above it
    )
    def test_early_touch_down_is_on_ground(self, cycle: FootCycle, above_m: float, stands_m: float) -> None:
        """The planned height of the foot does not matter, because the body may be tilted."""
        lift_feet(cycle, 1)
        cycle.each_foot[0].z, cycle.each_foot[1].z = -0.002, 0.02
        cycle.touch_down(np.array([False, True]), np.array([-0.3, -0.298 + above_m]))
        np.testing.assert_allclose(cycle.feet[:, 2], [-0.002, stands_m], atol=1e-12)

    def test_a_touch_down_without_standing_feet_keeps_its_height(self, cycle: FootCycle) -> None:
        lift_feet(cycle, 0, 1)
        cycle.each_foot[1].z = 0.02
        cycle.touch_down(np.array([False, True]), np.array([-0.4, -0.3]))
        assert cycle.feet[1, 2] == pytest.approx(0.02)

    def test_the_clock_runs_a_cycle_in_a_period(self, cycle: FootCycle) -> None:
        cycle.advance(REST, 0.5, 0.04, BOTH)
        assert cycle.clock == pytest.approx(0.25)
        np.testing.assert_allclose(cycle.phases(), [0.25, 0.75])
        for _ in range(4):
            cycle.advance(REST, 0.5, 0.04, BOTH)
        assert cycle.clock == pytest.approx(0.25)


class TestLimits:
    """Joint speeds of a steady walk of the hexapod, compared with a finely sampled walk."""

    ROBOT = load_robot("hexapod")
    TIMING = GaitTiming(1.0, 0.65)
    SWAY = SwayPlan(np.array([0.01 + 0.02j, 0.03j]), np.zeros(2, complex))

    def steady(self, velocity: tuple[float, float, float], height_m: float = 0.2) -> SteadyWalk:
        legs = self.ROBOT.legs
        nominal_feet = legs.default_foot * [1.0, 1.0, 0.0]
        footing = Footing(nominal_feet, np.tile(np.diag([0.9, 0.8]), (6, 1, 1)))
        offsets, below = np.arange(6) / 6, height_m - legs.foot_radius
        return SteadyWalk(footing, self.TIMING, offsets, np.array(velocity), 0.03, self.SWAY, below)

    def angles(self, walk: SteadyWalk, samples: int) -> tuple[np.ndarray, float]:
        """All joint angles during each foot's swing, and the largest distance of a tip from its position."""
        legs, progress = self.ROBOT.legs, np.linspace(0.0, 1.0, samples)
        feet = steady_cycle(walk.footing, walk.timing, walk.velocity, walk.step_height_m, progress)
        for k, s in enumerate(progress):
            turn = np.exp(2j * np.pi * (0.65 + 0.35 * s - walk.offsets))[:, None]
            feet[k, :, :2] -= (turn * walk.sway.body).real
            feet[k, :, 2] -= walk.below_m
        found = np.array([legs.solve(each) for each in feet])
        tips = [legs.pose(legs.scatter(each, self.ROBOT.default_pose)).foot for each in found]
        return found, float(np.abs(np.array(tips) - feet).max())

    def limits(self, share: float) -> WalkLimits:
        return WalkLimits(self.ROBOT, np.zeros(2), LimitsConfig(rate_share=share))

    def test_the_walk_is_as_fast_as_its_fastest_joint_permits(self) -> None:
        walk = self.steady((0.03, -0.04, 0.1))
        angles, _ = self.angles(walk, 301)
        fastest = np.abs(np.diff(angles, axis=0)).max() / (0.35 / 300)
        pace = self.limits(0.2).pace(walk)
        assert pace.stride == 1.0
        assert pace.tempo == pytest.approx(0.2 * 3.0 / fastest, rel=0.06)
        assert pace.reason.startswith("the gait is slowed to a period of ")

    @pytest.mark.parametrize(("speed", "stride"), [(0.4, 0.8), (0.5, 0.6), (0.6, 0.6)])
    def test_strides_are_shortened_to_the_legs_reach(self, speed: float, stride: float) -> None:
        """Strides are shortened even if feet are out of reach only briefly in a swing."""
        walk = self.steady((speed, 0.0, 0.0))
        pace = self.limits(1.0).pace(walk)
        assert pace.reason.startswith("strides are shortened: feet would be out of the legs' reach")
        assert pace.stride == stride
        for share, reached in ((pace.stride, True), (pace.stride + 0.2, False)):
            _, missed = self.angles(walk._replace(velocity=share * walk.velocity), 13)
            assert (missed < 0.003) == reached

    def test_a_body_too_high_for_its_legs_does_not_walk(self) -> None:
        pace = self.limits(1.0).pace(self.steady((0.01, 0.0, 0.0), height_m=1.0))
        assert pace.stride == 0.0
        reason = "the robot does not walk, however short its strides are: feet would be out of the legs'"
        assert pace.reason.startswith(reason)
