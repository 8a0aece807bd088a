"""Named gaits: the order of the feet, on any robot with that number of feet."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.policies import gaits
from footfall.policies.gaits import GaitEntry, find_gait, gaits_of, planned_lift, require_duty
from footfall.robots.description import Robot

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
    seven = standing_at(go1, {name: (0.1 * k, 0.1) for k, name in enumerate("abcdefg")})
    with pytest.raises(UserError, match=r"'trot' .*7 .*'go1'"):
        find_gait("trot", seven)


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
