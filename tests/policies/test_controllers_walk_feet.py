"""Feet, limits, sway and contact of the gait generator at single times, calculated by hand."""

import math

import numpy as np
import pytest
from moments import readings

from footfall.policies.controllers.gait import GaitTiming
from footfall.policies.controllers.walk.config import LimitsConfig
from footfall.policies.controllers.walk.feet import FootCycle, stances, steady_cycle
from footfall.policies.controllers.walk.foot import Foot, Footing, blend, lift
from footfall.policies.controllers.walk.ground import GroundForce
from footfall.policies.controllers.walk.limits import SteadyWalk, WalkLimits
from footfall.policies.controllers.walk.sway import Sway, SwayPlan, plan_sway, sine_at
from footfall.policies.gaits import find_gait
from footfall.robots.actuator import friction_torque
from footfall.robots.description import load_robot
from footfall.robots.readings import Sensed
from footfall.robots.rigid_body import nominal_body
from footfall.robots.support import support_margin

TIMING = GaitTiming(period_s=2.0, duty=0.6)  # stands for 1.2 s, swings for 0.8 s
FEET, OFFSETS = np.array([[0.3, 0.2, 0.0], [-0.2, -0.1, 0.0]]), np.array([0.0, 0.5])
FOOTING = Footing(FEET, np.tile(np.eye(2), (2, 1, 1)))  # of points, which do not roll
BOTH, REST = (True, True), [0.0, 0.0, 0.0]
VELOCITY = np.array([0.1, -0.05, 0.2])
PASSING = np.array([[0.1 - 0.04, -0.05 + 0.06, 0.0], [0.1 + 0.02, -0.05 - 0.04, 0.0]])  # v + w x r

HEXAPOD = load_robot("hexapod")
LEGS, BODY, POSE = HEXAPOD.legs, nominal_body(HEXAPOD), HEXAPOD.default_pose
FLAT = LEGS.default_foot * [1.0, 1.0, 0.0]


@pytest.fixture
def cycle() -> FootCycle:
    return FootCycle(FOOTING, TIMING, OFFSETS)


def test_a_blend_and_a_lift_are_at_rest_at_both_ends() -> None:
    np.testing.assert_allclose(blend(np.array([0.0, 0.2, 0.5, 0.8, 1.0])), [0, 0.05792, 0.5, 0.94208, 1])
    lifted = [lift(s) for s in (0.0, 0.25, 0.5, 0.75, 1.0)]
    np.testing.assert_allclose(lifted, [0, 0.5, 1, 0.5, 0], atol=1e-15)


def test_a_steady_stance_moves_backward_with_the_ground() -> None:
    """At clock 0.15 the first foot has completed a quarter of its stance; the other is in the air."""
    (first, second) = stances(FOOTING, TIMING, OFFSETS, VELOCITY, np.array([0.15, 0.55]))
    np.testing.assert_allclose(first, (FEET + 0.25 * 1.2 * PASSING)[:1, :2])
    share = 0.5 - np.array([[0.55], [0.05]]) / 0.6
    np.testing.assert_allclose(second, (FEET + share * 1.2 * PASSING)[:, :2])


def test_a_rolling_foots_stance_is_symmetric_about_its_position() -> None:
    """The foot moves at its share of v + w x r."""
    askew = Footing(FEET, np.tile(np.array([[0.9, 0.1], [0.2, 0.8]]), (2, 1, 1)))
    ends = steady_cycle(askew, TIMING, np.array([0.1, 0.0, 0.0]), 0.0, np.array([0.0, 1.0]))
    np.testing.assert_allclose(ends.mean(axis=0), FEET, atol=1e-12)
    np.testing.assert_allclose((ends[1] - ends[0])[:, :2], np.tile([0.9 * 0.12, 0.2 * 0.12], (2, 1)))
    half = Footing(FEET, np.tile(0.5 * np.eye(2), (2, 1, 1)))
    np.testing.assert_allclose(half.passing_velocity(VELOCITY, FEET[:, :2]), 0.5 * PASSING[:, :2])


def test_a_swinging_foot_is_between_two_points_that_move_with_the_ground() -> None:
    """At three quarters of the swing the blend is 459 / 512, the lift is half, and 0.2 s remain.

    The foot rolls, under a body that moves ahead and to the right, and turns left.
    """
    rolling, share = [[0.9, 0.05], [-0.02, 0.8]], 459 / 512
    nominal, here = np.array([[0.3, 0.2], [0.25, 0.23]])

    def passing(point: np.ndarray) -> np.ndarray:
        return np.array(rolling) @ (VELOCITY[:2] + np.cross([0.0, 0.0, 0.2], [*point, 0.0])[:2])

    foot = Foot(nominal.tolist(), rolling)
    foot.x, foot.y, foot.z = *here.tolist(), 0.01
    foot.lift_off(0.04)
    foot.fly(VELOCITY.tolist(), 0.5, 0.75, TIMING)
    start = here - 0.5 * passing(here)
    stance = nominal + 0.6 * passing(nominal)
    assert (foot.x, foot.y) == pytest.approx(tuple(start + share * (stance + 0.2 * passing(stance) - start)))
    assert foot.z == pytest.approx((1 - share) * 0.01 + 0.5 * 0.04)
    assert foot.progress == 0.75
    foot.fly(VELOCITY.tolist(), 0.1, 1.0, TIMING)
    assert (foot.x, foot.y, foot.z) == pytest.approx((*stance, 0.0))


def test_a_foot_lifts_off_at_its_duty_and_lands_at_the_cycles_end(cycle: FootCycle) -> None:
    for dt_s, swings, progress in ((1.19, False, 0.0), (0.41, True, 0.5), (0.41, False, 0.0)):
        cycle.advance(REST, dt_s, 0.04, BOTH)
        assert cycle.swings.tolist() == [swings, False]
        np.testing.assert_allclose(cycle.progress, [progress, 0.0])
        np.testing.assert_allclose(cycle.feet, FEET + np.outer([swings, False], [0.0, 0.0, 0.04]), atol=1e-9)


def test_after_a_reset_all_feet_are_at_their_nominal_positions(cycle: FootCycle) -> None:
    for _ in range(14):
        cycle.advance(VELOCITY.tolist(), 0.1, 0.04, BOTH)
    assert cycle.swings.any()
    cycle.reset()
    assert (cycle.clock, cycle.swings.any(), cycle.progress.any()) == (0.0, False, False)
    np.testing.assert_array_equal(cycle.feet, FEET)


@pytest.mark.parametrize("seed", range(20))
def test_a_new_gait_begins_with_the_smallest_travel(cycle: FootCycle, seed: int) -> None:
    """All 24 clocks are tried. Only the travel so far includes the body's rotation."""
    rng = np.random.default_rng(seed)
    timing, offsets = GaitTiming(float(rng.uniform(0.3, 3.0)), 0.6), rng.uniform(size=2)
    velocity = [*rng.uniform(-0.2, 0.2, 2).tolist(), float(rng.uniform(-2.0, 2.0))]
    for foot in cycle.each_foot:
        foot.x += float(rng.uniform(-0.1, 0.1))
    waits_s = (0.6 - np.arange(24)[:, None] / 24 - offsets) % 1.0 * timing.period_s
    travel = np.array([foot.travel(velocity) for foot in cycle.each_foot]) + np.hypot(*velocity[:2]) * waits_s
    cycle.change_gait(timing, offsets, velocity)
    assert cycle.clock == np.argmin(travel.max(axis=1)) / 24


def test_only_standing_feet_are_lowered_and_only_to_the_limit(cycle: FootCycle) -> None:
    cycle.lower([True, False], 0.004, -0.01)
    np.testing.assert_allclose(cycle.feet[:, 2], [-0.004, 0.0])
    for _ in range(3):
        cycle.lower([True, False], 0.004, -0.01)
    np.testing.assert_allclose(cycle.feet[:, 2], [-0.01, 0.0])
    cycle.each_foot[1].lift_off(0.03)
    for lowest_m in (-0.01, -0.002):  # no foot is raised to a higher bound
        cycle.lower([True, True], 0.004, lowest_m)
        np.testing.assert_allclose(cycle.feet[:, 2], [-0.01, 0.0])


@pytest.mark.parametrize(
    ("above_m", "stands_m"),
    [(0.012, 0.012), (0.0, 0.0), (-0.01, 0.0), (0.1, 0.03)],  # a swing of 3 cm meets no ground above it
)
def test_early_touch_down_is_on_ground(cycle: FootCycle, above_m: float, stands_m: float) -> None:
    """The planned height of the foot does not matter, because the body may be tilted."""
    cycle.each_foot[1].lift_off(0.03)
    cycle.each_foot[0].z, cycle.each_foot[1].z = -0.002, 0.02
    cycle.touch_down(np.array([False, True]), np.array([-0.3, -0.298 + above_m]))
    np.testing.assert_allclose(cycle.feet[:, 2], [-0.002, stands_m], atol=1e-12)


def test_a_touch_down_without_standing_feet_keeps_its_height(cycle: FootCycle) -> None:
    for foot in cycle.each_foot:
        foot.lift_off(0.03)
    cycle.each_foot[1].z = 0.02
    cycle.touch_down(np.array([False, True]), np.array([-0.4, -0.3]))
    assert cycle.feet[1, 2] == pytest.approx(0.02)


def test_the_clock_runs_a_cycle_in_a_period(cycle: FootCycle) -> None:
    for ticks in (1, 4):
        for _ in range(ticks):
            cycle.advance(REST, 0.5, 0.04, BOTH)
        np.testing.assert_allclose([cycle.clock, *cycle.phases()], [0.25, 0.25, 0.75])


@pytest.mark.parametrize("gait", ["tripod", "ripple", "wave"])
def test_position_and_velocity_are_continuous(gait: str) -> None:
    """A swing of this length and height accelerates by at most 5 m/s^2: 0.005 m/s in a millisecond."""
    duty, phase = find_gait(gait, HEXAPOD)
    points, positions = Footing(FLAT, np.tile(np.eye(2), (6, 1, 1))), []
    feet = FootCycle(points, GaitTiming(1.3, duty), phase)
    for _ in range(4000):
        feet.advance([0.08, -0.05, 0.2], 0.001, 0.03, [True] * 6)
        positions.append(feet.feet.copy())
    limit = (0.03 * 2 * np.pi**2 + 5.8 * 0.12) / feet.timing.swing_s**2
    assert np.abs(np.diff(positions, 2, axis=0)).max() / 0.001**2 < 1.5 * limit
    assert np.abs(np.diff(positions, axis=0)).max() < 0.002


class TestLimits:
    """Joint speeds of a steady walk of the hexapod, compared with a finely sampled walk."""

    def steady(self, velocity: tuple[float, float, float], height_m: float = 0.2) -> SteadyWalk:
        footing = Footing(FLAT, np.tile(np.diag([0.9, 0.8]), (6, 1, 1)))
        sway = SwayPlan(np.array([0.01 + 0.02j, 0.03j]), np.zeros(2, complex))
        timing, offsets, below_m = GaitTiming(1.0, 0.65), np.arange(6) / 6, height_m - LEGS.foot_radius
        return SteadyWalk(footing, timing, offsets, np.array(velocity), 0.03, sway, below_m)

    def angles(self, walk: SteadyWalk, samples: int) -> tuple[np.ndarray, float]:
        """All joint angles during each foot's swing, and the largest distance of a tip from its position."""
        progress = np.linspace(0.0, 1.0, samples)
        feet = steady_cycle(walk.footing, walk.timing, walk.velocity, walk.step_height_m, progress)
        for k, s in enumerate(progress):
            turn = np.exp(2j * np.pi * (0.65 + 0.35 * s - walk.offsets))[:, None]
            feet[k, :, :2] -= (turn * walk.sway.body).real
            feet[k, :, 2] -= walk.below_m
        found = np.array([LEGS.solve(each) for each in feet])
        tips = [LEGS.pose(LEGS.scatter(each, POSE)).foot for each in found]
        return found, float(np.abs(np.array(tips) - feet).max())

    def limits(self, share: float) -> WalkLimits:
        return WalkLimits(HEXAPOD, np.zeros(2), LimitsConfig(rate_share=share))

    def test_the_walk_is_as_fast_as_its_fastest_joint_permits(self) -> None:
        walk = self.steady((0.03, -0.04, 0.1))
        fastest = np.abs(np.diff(self.angles(walk, 301)[0], axis=0)).max() / (0.35 / 300)
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
            _, error_m = self.angles(walk._replace(velocity=share * walk.velocity), 13)
            assert (error_m < 0.003) == reached

    def test_a_body_too_high_for_its_legs_does_not_walk(self) -> None:
        pace = self.limits(1.0).pace(self.steady((0.01, 0.0, 0.0), height_m=1.0))
        assert pace.stride == 0.0
        reason = "the robot does not walk, however short its strides are: feet would be out of the legs'"
        assert pace.reason.startswith(reason)


class TestSwayPlan:
    """Feet at the corners of a rectangle, one in the air at a time."""

    ASIDE, HEIGHT_M = 0.15, 0.2452  # w^2 h / g = 1 where w^2 = 40 / s^2
    FEET = np.array([[0.2, 0.15], [0.2, -0.15], [-0.2, 0.15], [-0.2, -0.15]])  # FL FR HL HR
    # Hind left in the air until 1/4, then front left, hind right, front right.
    OFFSETS = np.array([0.5, 0.0, 0.75, 0.25])

    def plan(self, period_s: float = 1.0, share: float = 1.0) -> SwayPlan:
        return plan_sway(self.FEET, GaitTiming(period_s, 0.75), self.OFFSETS, self.HEIGHT_M, share)

    def test_the_body_sways_to_the_side_with_both_feet_down(self) -> None:
        """The middle of three corners is a third of the half width away, so the ideal sway is a square wave.

        The first sine of this sway has 4 / pi of the amplitude.
        """
        amplitude = 4 / math.pi * self.ASIDE / 3
        found = sine_at(self.plan().pressure, np.array([0.0, 0.25, 0.5, 0.75]))
        np.testing.assert_allclose(found, np.outer([0.0, -amplitude, 0.0, amplitude], [0.0, 1.0]), atol=1e-3)

    @pytest.mark.parametrize("period_s", [100.0, 1.0, 0.5])
    def test_the_body_moves_less_in_a_faster_gait(self, period_s: float) -> None:
        plan, rate = self.plan(period_s), 2 * math.pi / period_s
        np.testing.assert_allclose(plan.body * (1 + rate**2 * self.HEIGHT_M / 9.81), plan.pressure, rtol=2e-4)
        for share in (0.0, 0.5, 1.25):
            np.testing.assert_allclose(self.plan(period_s, share).body, share * plan.body, atol=1e-12)
        trot = np.array([0.5, 0.0, 0.0, 0.5])  # feet that alternate about the middle need no sway
        none = plan_sway(self.FEET, GaitTiming(period_s, 0.5), trot, self.HEIGHT_M, 1.0)
        np.testing.assert_allclose(none.body, 0.0, atol=1e-12)

    def test_with_the_sway_the_weight_is_well_inside_the_three_feet_that_stand(self) -> None:
        """At 1/8 the hind left foot is in the air.

        The sway is 0.0637 sin 45 degrees = 0.045 m to the right; 0.8 of it is inside the support.
        """
        three = [(x, y) for x, y in self.FEET[[0, 1, 3]].tolist()]
        assert support_margin(three, (0.0, 0.0)) == pytest.approx(0.0)
        x, y = sine_at(self.plan(2.0).pressure, 0.125).tolist()
        assert support_margin(three, (x, y)) == pytest.approx(0.8 * 0.045, abs=1e-3)

    def test_a_walk_begins_where_the_body_turns_back(self) -> None:
        """The body turns back on the right at 1/4, and on the left at 3/4, when the front foot lifts off."""
        assert (self.plan().start(0.4) + 0.02) % 0.5 == pytest.approx(0.25, abs=3e-3)
        assert self.plan(share=0.0).start(0.4) == 0.4

    @pytest.mark.parametrize("phase", [0.8, -2.0])
    def test_a_walk_begins_a_little_before_the_body_is_farthest_out(self, phase: float) -> None:
        """The larger sway, cos(2 pi t + phase) at clock t, is farthest out at t = -phase / (2 pi)."""
        body = np.array([0.01j, 0.05 * np.exp(1j * phase)])
        start = SwayPlan(body, body).start(0.4)
        assert start == pytest.approx((-phase / (2 * math.pi) - 0.02) % 1.0)
        before, at, after = (float(sine_at(body, start + 0.02 + d)[1]) for d in (-0.01, 0.0, 0.01))
        assert max(before, after) < at == pytest.approx(0.05)

    def test_in_flight_the_target_pressure_is_in_the_middle(self) -> None:
        """A foot at 0.1 m stands for a quarter of the cycle, around clock 1/8.

        The first harmonic of its position has the amplitude 2 * 0.1 sin(pi / 4) / pi, and its maximum at 1/8.
        """
        plan = plan_sway(np.array([[0.1, 0.0]]), GaitTiming(1.0, 0.25), np.zeros(1), self.HEIGHT_M, 1.0)
        found = sine_at(plan.pressure, np.array([0.125, 0.375]))
        amplitude = 0.2 * math.sin(math.pi / 4) / math.pi
        np.testing.assert_allclose(found, [[amplitude, 0.0], [0.0, 0.0]], atol=1e-3)


def test_the_sway_is_approached_within_a_quarter_cycle_without_a_jump() -> None:
    sway, path, goal = Sway(), [0.0], np.array([0.0, 0.05 + 0.0j])
    for _ in range(250):
        sway.approach(goal, 0.001)
        path.append(float(sway.at(0.0)[1]))
    assert 0.045 < path[-1] < 0.05
    assert np.abs(np.diff(path, 2)).max() < 2e-5
    assert sway.distance(goal) == pytest.approx(0.05 - path[-1])
    sway.reset()
    assert sway.at(0.3) == (0.0, 0.0)


@pytest.mark.parametrize("cycles", [1 / 16, 1.0])
def test_a_long_tick_does_not_overshoot_the_sway(cycles: float) -> None:
    """Afterwards the sway equals the plan's sine at any clock."""
    sway, goal = Sway(), np.array([0.03 + 0.02j, -0.01 + 0.04j])
    sway.approach(goal, cycles)
    assert sway.distance(goal) == pytest.approx(0.0, abs=1e-12)
    for clock in (0.0, 0.2, 0.7):
        np.testing.assert_allclose(sway.at(clock), sine_at(goal, clock), atol=1e-12)
    angle = 2 * math.pi * 0.2
    assert sway.at(0.2)[1] == pytest.approx(-0.01 * math.cos(angle) - 0.04 * math.sin(angle))


class TestGroundForce:
    """Contact of the hexapod's feet from the motors' torques."""

    JACOBIAN = LEGS.pose(POSE).jacobian
    STILL, FREE = np.zeros(18), np.zeros((6, 3))
    FALL = np.tile([[0.0], [0.0], [-5.0]], (6, 1, 1))  # m/s^2, of each foot
    LOWERING = LEGS.scatter(LEGS.joint_rates(JACOBIAN, FALL)[:, :, 0], STILL)  # rad/s^2
    # Force on the left middle foot, N, and in shares of the weight.
    LOADED = np.outer([0, 1, 0, 0, 0, 0], [0.0, 0.0, 1.5 * 9.81 * 3.01 / 6])
    LOADED_SHARES = (0.0, 1.5, 0.0, 0.0, 0.0, 0.0)

    def readings(self, force: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> Sensed:
        """Readings of a robot whose motors move the legs and push on the ground with forces (6, 3)."""
        inertial = (BODY.leg_inertia @ LEGS.gather(acceleration)[:, :, None])[:, :, 0]
        weight = LEGS.holding_torque(POSE, np.array([0.0, 0.0, 9.81]))
        torque = LEGS.scatter(weight + LEGS.torque(self.JACOBIAN, force) + inertial, self.STILL)
        return readings(HEXAPOD, velocity=velocity, torque=torque - friction_torque(velocity, HEXAPOD.motor))

    def shares(
        self,
        force: np.ndarray,
        acceleration: np.ndarray,
        rate: float = 0.0,
        heavier: float = 1.0,
        uncertainty: float = 0.0,
    ) -> np.ndarray:
        """Shares (6,) after 0.2 s in a force, from rest; the legs' pose is constant."""
        ground = GroundForce(HEXAPOD, BODY, 0.015, uncertainty)
        ground.reset(self.readings(self.FREE, rate + self.STILL, self.STILL))
        for tick in range(1, 51):
            velocity = rate + tick * 0.004 * acceleration
            sensed = self.readings(force, velocity, heavier * acceleration)
            shares = ground.update(sensed, self.JACOBIAN, 0.004)
        return shares

    def test_gearbox_friction_and_accelerated_legs_are_not_mistaken_for_ground(self) -> None:
        """Friction at 2 rad/s is 0.13 N m, at least a fifth of a share; the acceleration takes three."""
        np.testing.assert_allclose(self.shares(self.FREE, self.STILL, rate=2.0), 0.0, atol=0.01)
        np.testing.assert_allclose(self.shares(self.FREE, self.LOWERING), 0.0, atol=0.05)
        np.testing.assert_allclose(self.shares(self.LOADED, self.LOWERING), self.LOADED_SHARES, atol=0.05)

    def test_legs_heavier_than_described_have_contact_only_where_the_ground_stops_them(self) -> None:
        assert self.shares(self.FREE, self.LOWERING, heavier=1.2).min() > 0.4
        found = self.shares(self.FREE, self.LOWERING, heavier=1.2, uncertainty=0.2)
        np.testing.assert_allclose(found, 0.0, atol=0.05)
        # A foot that the ground stops is still recognised at once.
        braked = self.shares(self.LOADED, -self.LOWERING, uncertainty=0.2)
        np.testing.assert_allclose(braked, self.LOADED_SHARES, atol=0.05)
