"""Named gaits of any robot, and what walking controllers share: clock, swing, command limits, delay."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from moments import readings

from footfall import JointCommand, Robot, UserError
from footfall.policies import gaits
from footfall.policies.controllers.command import CommandShaping, ShapedCommand
from footfall.policies.controllers.delay import CommandDelay
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
from footfall.policies.gaits import GaitEntry, find_gait, gaits_of, planned_lift, require_duty
from footfall.robots.actuator import motor_torque

CLOCKS = np.arange(0.005, 1.0, 0.01).tolist()


def standing_at(go1: Robot, feet_xy: Mapping[str, tuple[float, float]]) -> Robot:
    """A robot with other feet, given by their names and positions."""
    feet = tuple(replace(go1.description.feet[0], name=name) for name in feet_xy)
    positions = np.array([(*place, -0.2) for place in feet_xy.values()])
    return replace(go1, description=replace(go1.description, feet=feet), foot_positions=positions)


def lift_offs(robot: Robot, name: str) -> list[str]:
    """Names of the feet in the order in which they leave the ground, from the clock's 0 on."""
    gait = find_gait(name, robot)
    order = np.argsort((gait.duty - gait.phase) % 1.0, kind="stable")
    return [robot.description.feet[k].name for k in order]


def in_the_air(robot: Robot, name: str, clock: float) -> set[str]:
    gait = find_gait(name, robot)
    swings = (clock + gait.phase) % 1.0 >= gait.duty
    return {foot.name for foot, up in zip(robot.description.feet, swings, strict=True) if up}


def counts(robot: Robot, name: str) -> list[int]:
    """Numbers of feet in the air in a cycle."""
    return [len(in_the_air(robot, name, clock)) for clock in CLOCKS]


HEXAPOD = {  # feet in an arbitrary order, the middle ones farther out
    **{"RM": (0.01, -0.3), "LR": (-0.2, 0.22), "RF": (0.21, -0.2)},
    **{"LM": (0.0, 0.3), "RR": (-0.19, -0.21), "LF": (0.2, 0.2)},
}


@pytest.fixture
def hexapod(go1: Robot) -> Robot:
    return standing_at(go1, HEXAPOD)


def test_a_trot_steps_with_diagonals_a_pace_with_sides_and_a_bound_with_ends(go1: Robot) -> None:
    diagonals = {frozenset({"FR", "RL"}), frozenset({"FL", "RR"})}
    assert {frozenset(in_the_air(go1, "trot", clock)) for clock in CLOCKS} == diagonals
    assert in_the_air(go1, "pace", 0.1) == {"FL", "RL"}
    assert in_the_air(go1, "bound", 0.1) == {"RL", "RR"}
    assert set(counts(go1, "pace")) == set(counts(go1, "bound")) == {2}


def test_a_walk_steps_hind_before_front_on_each_side_one_foot_at_a_time(go1: Robot) -> None:
    assert lift_offs(go1, "walk") == ["RL", "FL", "RR", "FR"]
    assert set(counts(go1, "walk")) == {1}


@pytest.mark.parametrize(("gait", "share"), [("gallop", 0.35), ("pronk", 0.5)])
def test_a_flight_has_no_foot_on_the_ground(go1: Robot, gait: str, share: float) -> None:
    assert counts(go1, gait).count(4) == pytest.approx(100 * share, abs=1)


def test_two_feet_step_in_turn_and_stand_together_for_a_fifth_of_the_cycle(go1: Robot) -> None:
    biped = standing_at(go1, {"L": (0.0, 0.1), "R": (0.0, -0.1)})
    assert sorted(counts(biped, "walk")) == [0] * 20 + [1] * 80
    for clock, feet in ((0.005, set()), (0.2, {"L"}), (0.7, {"R"})):
        assert in_the_air(biped, "walk", clock) == feet


def test_a_tripods_feet_are_front_and_hind_with_the_others_middle(hexapod: Robot) -> None:
    assert in_the_air(hexapod, "tripod", 0.3) == {"LF", "RM", "LR"}
    assert in_the_air(hexapod, "tripod", 0.8) == {"RF", "LM", "RR"}
    assert in_the_air(hexapod, "tripod", 0.55) == set()  # each stands for 65 % of the cycle


def test_a_wave_lifts_one_foot_every_sixth_of_the_cycle(hexapod: Robot) -> None:
    order = lift_offs(hexapod, "wave")
    first = order.index("LR")
    assert order[first:] + order[:first] == ["LR", "LM", "LF", "RR", "RM", "RF"]
    assert set(counts(hexapod, "wave")) == {1}


def test_a_ripple_has_two_feet_in_the_air_never_neighbours(hexapod: Robot) -> None:
    neighbours = [{"LF", "LM"}, {"LM", "LR"}, {"RF", "RM"}, {"RM", "RR"}, {"LF", "RF"}, {"LR", "RR"}]
    for clock in CLOCKS:
        up = in_the_air(hexapod, "ripple", clock)
        assert len(up) == 2
        assert up not in neighbours


def test_feet_in_the_middle_plane_have_their_own_phases_from_front_to_back(
    go1: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of five feet, three stand in the middle plane; a foot a millimetre beside it belongs to a side."""
    feet = {"b": (-0.3, -5e-4), "r": (0.0, -0.001), "f": (0.3, 1e-7), "l": (0.1, 0.2), "m": (0.2, 5e-4)}
    hop = {"duty": 0.6, "left": [0.1], "right": [0.2], "middle": [0.3, 0.4, 0.5]}
    limp = hop | {"left": [0.1, 0.7], "middle": [0.3, 0.4]}
    monkeypatch.setattr(gaits, "_gaits_by_feet", lambda: {5: {"hop": hop, "limp": limp}})
    found = find_gait("hop", standing_at(go1, feet))
    assert found.duty == 0.6
    np.testing.assert_array_equal(found.phase, [0.5, 0.2, 0.3, 0.1, 0.4])
    with pytest.raises(UserError, match=r"'limp' .*2 .*left.* 1"):
        find_gait("limp", standing_at(go1, feet))
    with pytest.raises(UserError, match=r"'hop' .*1 .*right.* 2"):
        find_gait("hop", standing_at(go1, feet | {"m": (0.2, -0.1)}))


def test_a_robot_has_the_gaits_for_as_many_feet_on_each_side(go1: Robot, hexapod: Robot) -> None:
    """Gaits are in the order of the file; a new robot begins with the first."""
    assert gaits_of(go1) == ["trot", "walk", "pace", "bound", "gallop", "pronk"]
    assert gaits_of(hexapod) == ["tripod", "ripple", "wave"]
    tail = {"a": (0.2, 0.1), "b": (0.2, -0.1), "c": (-0.1, 0.1), "d": (-0.1, -0.1), "e": (-0.3, 0.0)}
    assert gaits_of(standing_at(go1, tail)) == ["wave"]
    assert gaits_of(standing_at(go1, tail | {"e": (-0.3, 0.1)})) == []  # three on the left
    with pytest.raises(UserError, match=r"'trot' .*7 .*'go1'"):
        find_gait("trot", standing_at(go1, {name: (0.1 * k, 0.1) for k, name in enumerate("abcdefg")}))


def test_duties_and_phases_are_shares_of_a_cycle() -> None:
    for duty in (0.0, 1.0, -0.1, float("nan")):
        for refuses in (require_duty, GaitEntry):
            with pytest.raises(ValueError, match="duty"):
                refuses(duty)
    for duty in (None, 0.01):
        require_duty(duty)
    for side in ("left", "right", "middle"):
        for phase in (-0.1, 1.1):
            with pytest.raises(ValueError, match=side):
                GaitEntry(0.5, **{side: (0.2, phase)})


def test_a_planned_lift_is_a_half_sine_over_the_swing() -> None:
    """A duty of 0.75 leaves a quarter of the cycle for the swing, which is first."""
    clock = np.array([[0], [1], [3], [5], [6], [14.4]]) / 24
    lift = planned_lift(clock, np.zeros(1), 0.75)[:, 0]
    np.testing.assert_allclose(lift, [0.0, 0.5, 1.0, 0.5, 0.0, 0.0], atol=1e-12)
    # With a duty of one half it is the sine of the clock.
    clock, offsets = np.linspace(0.0, 3.0, 101)[:, None], np.array([0.0, 0.3])
    sine = np.maximum(np.sin(2 * np.pi * (clock + offsets)), 0.0)
    np.testing.assert_allclose(planned_lift(clock, offsets, 0.5), sine, atol=1e-12)


TROT = np.array([0.0, 0.5, 0.5, 0.0])


def test_trust_rises_and_falls_over_the_edges_of_the_stance() -> None:
    """A tenth of a stance of 0.8 cycles is 0.08 cycles, so trust is one half after 0.04."""
    trust = contact_trust(np.array([0.02, 0.04, 0.08, 0.72, 0.76, 0.78]), duty=0.8, edge=0.1)
    np.testing.assert_allclose(trust, [0.25, 0.5, 1.0, 1.0, 0.5, 0.25])
    trust = contact_trust(np.array([0.0, 0.25, 0.5, 0.8]), duty=0.5, edge=0.2)
    np.testing.assert_allclose(trust, [0, 1, 0, 0])


def test_a_foot_lifts_off_at_its_duty_and_swings_for_the_rest() -> None:
    phases = np.array([0.0, 0.599, 0.6, 0.7, 0.999])
    assert in_stance(phases, 0.6).tolist() == [True, True, False, False, False]
    np.testing.assert_allclose(swing_progress(phases, 0.6), [0.0, 0.0, 0.0, 0.25, 0.9975])
    np.testing.assert_allclose(leg_phases(0.3, np.array([0.0, 0.2, 0.9])), [0.3, 0.5, 0.2])
    timing = GaitTiming(period_s=0.4, duty=0.7)
    assert (timing.stance_s, timing.swing_s) == pytest.approx((0.28, 0.12))


def test_a_clock_has_the_gaits_feet_and_duty_unless_another_duty_is_given(go1: Robot) -> None:
    clock = GaitConfig("walk", 0.9).clock(go1)
    assert (clock.timing.period_s, clock.timing.duty) == (0.9, 0.75)
    assert clock.offsets.tolist() == [0.0, 0.5, 0.25, 0.75]
    assert GaitConfig("walk", 0.9, duty=0.8).clock(go1).timing.duty == 0.8
    with pytest.raises(UserError, match="'tripod'"):
        GaitConfig("tripod", 0.9).clock(go1)


@pytest.mark.parametrize(
    ("period_s", "duty", "named"),
    [(0.0, 0.5, "period_s"), (-1.0, 0.5, "period_s"), (0.5, 0.0, "duty"), (0.5, 1.0, "duty")],
)
def test_a_gait_that_never_ends_or_never_steps_is_refused(period_s: float, duty: float, named: str) -> None:
    for make in (GaitTiming, lambda *each: GaitConfig("walk", *each)):
        with pytest.raises(ValueError, match=named):
            make(period_s, duty)


@pytest.mark.parametrize(("s", "height"), [(0.0, 0.0), (0.5, 1.0), (1.0, 0.0)])
def test_a_swing_moves_from_lift_off_to_touch_down(s: float, height: float) -> None:
    curve = swing_curve(s)
    found = curve.along.value, curve.height.value, curve.height.slope
    assert found == pytest.approx((s, height, 0.0), abs=1e-12)


@pytest.mark.parametrize(
    ("offsets", "duty", "left_s"),
    [
        (TROT, 0.5, 0.102),  # 0.148 s into a period of 0.5 s: the second diagonal lands at 0.25 s
        (TROT, 0.65, 0.102),
        (np.arange(6) / 6, 5 / 6, 0.0187),  # the swing of the leg that lands at a third of the period
    ],
)
def test_a_clock_stops_when_swings_are_over(offsets: np.ndarray, duty: float, left_s: float) -> None:
    clock = StepClock(GaitTiming(period_s=0.5, duty=duty), offsets)
    for _ in range(37):
        clock.advance(0.004, walk=True)
    assert not clock.stance().all()
    for _ in range(math.ceil(left_s / 0.004)):
        assert clock.walking
        clock.advance(0.004, walk=False)
    assert not clock.walking
    assert clock.stance().all()


def test_a_resting_clock_plans_to_stand() -> None:
    clock = StepClock(GaitTiming(0.4, 0.4), TROT)  # feet of phase 0.5 would be in the air
    clock.advance(1.0, walk=False)
    assert clock.planned_stance(np.linspace(0, 1, 5)).tolist() == [[True] * 4] * 5
    assert not clock.swing().any()


def test_a_clock_with_a_lead_announces_its_first_swings_and_keeps_the_feet_down_until_then() -> None:
    clock = StepClock(GaitTiming(0.4, 0.4), TROT, lead_s=0.2)  # feet of phase 0.5 are in the air at once
    clock.advance(0.05, walk=True)
    assert clock.stance().all()
    assert clock.planned_stance(np.array([0.1, 0.16])).all(axis=1).tolist() == [True, False]
    clock.advance(0.16, walk=True)
    assert clock.stance().sum() == 2


@pytest.mark.parametrize("begun_s", [0.0, 0.06, 0.17, 0.3])
def test_the_clock_follows_its_own_plan(begun_s: float) -> None:
    clock = StepClock(GaitTiming(0.4, 0.6), TROT)
    clock.advance(begun_s, walk=True)
    clock.advance(0.01, walk=True)
    for row, ahead in zip(clock.planned_stance(np.array([0.05, 0.15, 0.25])), (0.05, 0.1, 0.1), strict=True):
        clock.advance(ahead, walk=True)
        np.testing.assert_array_equal(clock.stance(), row)


@pytest.fixture
def shaped() -> ShapedCommand:
    """A command that is limited in acceleration; a small command means to stand."""
    return ShapedCommand(CommandShaping(2.0, yaw_acceleration_rad_s2=5.0, standing_command=0.1))


def test_each_axis_has_its_own_acceleration_in_both_directions(shaped: ShapedCommand) -> None:
    goal, found = [0.5, -0.9, 0.03], []
    for command in (goal, goal, goal, [0.0, 0.0, -2.0]):
        shaped.advance(np.array(command), 0.1)
        found.append(shaped.value)  # an array that later ticks do not change
    expected = [[0.2, -0.2, 0.03], [0.4, -0.4, 0.03], [0.5, -0.6, 0.03], [0.3, -0.4, -0.47]]
    np.testing.assert_allclose(found, expected)


@pytest.mark.parametrize(
    ("command", "walks"),
    [
        *(((0.06, 0.06, 0.06), True), ((0.05, 0.05, 0.05), False), ((0, 0, -0.2), True), ((0, 0, 0), False)),
        *(((0.1, 0.0, 0.0), False), ((0.0, -0.1, 0.0), False), ((0.0, 0.0, 0.1), False)),
    ],
)
def test_small_commands_of_all_axes_mean_stand(shaped: ShapedCommand, command: Any, walks: bool) -> None:
    assert shaped.requests_walk(np.array(command)) is walks
    shaped.advance(np.array(command), 0.5)
    assert shaped.value.any() == walks


def test_a_robot_walks_until_it_has_slowed_down_and_a_reset_stands(shaped: ShapedCommand) -> None:
    for command, walks in (
        ((0.0, 0.5, 0.0), True),
        ((0.05, 0.0, 0.0), False),
        ((0.0, 0.0, -2.0), True),  # turning on the spot is walking, too
        ((1.0, 1.0, 1.0), True),
    ):
        shaped.advance(np.array(command), 0.1)
        assert shaped.requests_walk(np.zeros(3)) is shaped.value.any().item() is walks
    shaped.reset()
    assert not shaped.requests_walk(np.zeros(3))


@pytest.mark.parametrize("delay_ticks", [1, 2, 8, 16])
def test_the_delay_of_commands_shows_in_the_reported_torques(go1: Robot, delay_ticks: int) -> None:
    rng, still, ones = np.random.default_rng(0), np.zeros(12), np.ones(12)
    delay, sent = CommandDelay(go1.motor, 0.002), [JointCommand(*np.zeros((5, 12)))]
    for tick in range(200):
        position = go1.default_pose + 0.01 * np.sin(0.1 * tick)
        active = sent[max(0, tick - delay_ticks)]
        torque = motor_torque(active, position, still, go1.motor) + 0.02 * rng.standard_normal(12)
        delay.measure(readings(go1, joint=position, torque=torque))
        wave = 2.0 * np.sin(0.13 * tick + np.arange(12))
        sent.append(JointCommand(position, still, 20.0 * ones, ones, wave))
        delay.record(sent[-1])
    assert delay.ticks == delay_ticks


def test_velocity_changes_are_relative_to_the_acting_command(go1: Robot) -> None:
    delay, ones = CommandDelay(go1.motor, 0.002), np.ones(12)
    for velocity in (1.0, 4.0, 9.0):
        delay.record(JointCommand(0.0 * ones, velocity * ones, ones, ones, 0.0 * ones))
    np.testing.assert_array_equal(delay.velocity_changes(), [5.0 * ones])  # a tick late: 9 is sent, 4 acts
