"""Requests of a command source are refused, clipped, or passed on as changes."""

import math
from types import MappingProxyType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from deploy_policies import Hold

from footfall.deploy.changes import Change
from footfall.deploy.command_source import UNKNOWN_POSE, Behaviour, Offer, Request, Status, Stop
from footfall.deploy.modes import Mode
from footfall.deploy.steering import Steering
from footfall.policies.live_settings import Applied, Span
from footfall.robots.description import Robot

FORWARD = np.array([0.4, 0.0, 0.0])
STATUS = Status(0.0, 0.0, Mode.WALKING, "a", FORWARD, FORWARD, 0.3, UNKNOWN_POSE, (), (), Offer())
RUN: Any = SimpleNamespace(walking_s=0.0, battery=STATUS.battery, status=STATUS)


class Steps(Hold):
    """Has a gait and settings that can be changed."""

    name = "a"
    gaits = ("trot", "walk")
    live_settings = MappingProxyType(
        {"step_height_m": Span(0.02, 0.1, 0.05), "body_height_m": Span(0.2, 0.3, 0.28)}
    )
    applied = Applied()

    def set_live(self, values: object) -> None: ...

    def take_up(self, gait: str) -> None: ...


class Scripted:
    """Steering of two policies, of which the second has no gaits, by a source whose requests are given."""

    def __init__(self, robot: Robot) -> None:
        other = Hold(robot)
        other.name = "b"
        self.source: Any = SimpleNamespace(poll=lambda _: self.request, stopped=None)
        self.steering = Steering(self.source, [Steps(robot), other])

    def changes(self, **request: Any) -> list[Change]:
        self.request = Request(FORWARD, **request)
        self.steering.poll(0, RUN, follow=True)
        return self.steering.take_changes()


@pytest.fixture
def scripted(go1: Robot) -> Scripted:
    return Scripted(go1)


def test_changes_are_clipped_noted_and_made_once(scripted: Scripted) -> None:
    gait, settings = scripted.changes(gait="walk", settings={"step_height_m": 0.03, "body_height_m": 9.0})
    assert (gait.gait, settings.settings) == ("walk", {"step_height_m": 0.03, "body_height_m": 0.3})
    assert len(scripted.steering.notes) == 1
    lower = {"step_height_m": 0.03, "body_height_m": 0.25}
    assert scripted.changes(gait="walk", settings=lower) == [Change(settings={"body_height_m": 0.25})]
    assert scripted.changes(gait="walk", settings=lower) == []


def test_unknown_policies_gaits_and_settings_are_refused_with_a_note(go1: Robot) -> None:
    unknown: tuple[dict[str, Any], ...] = ({"roll_rad": 0.1}, {"step_height_m": math.nan})
    for request in ({"policy": "c"}, {"gait": "waltz"}, *({"settings": each} for each in unknown)):
        scripted = Scripted(go1)
        assert scripted.changes(**request) == []
        (note,) = scripted.steering.notes
        assert "\n" not in note
        np.testing.assert_array_equal(scripted.steering.command, FORWARD)


def test_gait_and_settings_wait_for_the_next_policy(scripted: Scripted) -> None:
    assert scripted.changes(policy="b", gait="walk") == [Change(policy="b")]
    scripted.steering.serve("b")
    assert scripted.changes(policy="b", gait="walk") == []
    assert len(scripted.steering.notes) == 1  # b has no gaits
    assert scripted.changes(policy="a", gait="walk") == [Change(policy="a")]
    scripted.steering.serve("a")
    assert scripted.changes(policy="a", gait="walk") == [Change(gait="walk")]


def test_any_behaviour_but_walking_means_a_zero_command(scripted: Scripted) -> None:
    steering = scripted.steering
    for behaviour, lies in ((Behaviour.STAND, False), (Behaviour.LIE_DOWN, True)):
        scripted.changes(behaviour=behaviour)
        assert (steering.command.tolist(), steering.lie_down) == ([0.0, 0.0, 0.0], lies)


def test_a_stop_is_latched_and_a_damping_stop_replaces_it(scripted: Scripted) -> None:
    by_hand, again = Stop("by hand"), Stop("again", damp=True)
    for stopped, latched in ((None, None), (by_hand, by_hand), (None, by_hand), (again, again)):
        scripted.source.stopped = stopped
        assert scripted.steering.stop == latched
