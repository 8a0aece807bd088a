"""Requests of a command source are refused, clipped, or passed on as changes."""

import math
from types import SimpleNamespace
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

    @property
    def live_settings(self) -> dict[str, Span]:
        return {"step_height_m": Span(0.02, 0.1, 0.05), "body_height_m": Span(0.2, 0.3, 0.28)}

    applied = Applied()

    def set_live(self, values: object) -> None: ...

    def take_up(self, gait: str) -> None: ...


class ScriptedSource:
    """A command source that returns given requests."""

    def __init__(self) -> None:
        self.request = Request(FORWARD)
        self.stopped: Stop | None = None

    def poll(self, status: Status) -> Request:
        return self.request


@pytest.fixture
def source() -> ScriptedSource:
    return ScriptedSource()


@pytest.fixture
def steering(go1: Robot, source: ScriptedSource) -> Steering:
    other = Hold(go1)
    other.name = "b"
    return Steering(source, [Steps(go1), other])


def changes_of(steering: Steering) -> list[Change]:
    steering.poll(0, RUN, follow=True)
    return steering.take_changes()


def test_changes_are_clipped_noted_and_made_once(steering: Steering, source: ScriptedSource) -> None:
    source.request = Request(FORWARD, gait="walk", settings={"step_height_m": 0.03, "body_height_m": 9.0})
    gait, settings = changes_of(steering)
    assert (gait.gait, settings.settings) == ("walk", {"step_height_m": 0.03, "body_height_m": 0.3})
    assert len(steering.notes) == 1
    source.request = Request(FORWARD, gait="walk", settings={"step_height_m": 0.03, "body_height_m": 0.25})
    assert changes_of(steering) == [Change(settings={"body_height_m": 0.25})]
    assert changes_of(steering) == []


@pytest.mark.parametrize(
    "request_",
    [
        Request(FORWARD, policy="c"),
        Request(FORWARD, gait="waltz"),
        Request(FORWARD, settings={"roll_rad": 0.1}),
        Request(FORWARD, settings={"step_height_m": math.nan}),
    ],
)
def test_unknown_policies_gaits_and_settings_are_refused_with_a_note(
    steering: Steering, source: ScriptedSource, request_: Request
) -> None:
    source.request = request_
    assert changes_of(steering) == []
    assert len(steering.notes) == 1
    assert "\n" not in steering.notes[0]
    np.testing.assert_array_equal(steering.command, FORWARD)


def test_gait_and_settings_wait_for_the_next_policy(steering: Steering, source: ScriptedSource) -> None:
    source.request = Request(FORWARD, policy="b", gait="walk")
    assert changes_of(steering) == [Change(policy="b")]
    steering.serve("b")
    assert changes_of(steering) == []
    assert len(steering.notes) == 1  # b has no gaits
    source.request = Request(FORWARD, policy="a", gait="walk")
    assert changes_of(steering) == [Change(policy="a")]
    steering.serve("a")
    assert changes_of(steering) == [Change(gait="walk")]


def test_any_behaviour_but_walking_means_a_zero_command(steering: Steering, source: ScriptedSource) -> None:
    for behaviour, lies in ((Behaviour.STAND, False), (Behaviour.LIE_DOWN, True)):
        source.request = Request(FORWARD, behaviour=behaviour)
        steering.poll(0, RUN, follow=True)
        assert (steering.command.tolist(), steering.lie_down) == ([0.0, 0.0, 0.0], lies)


def test_a_stop_is_latched_and_a_damping_stop_replaces_it(steering: Steering, source: ScriptedSource) -> None:
    assert steering.stop is None
    source.stopped = Stop("by hand")
    assert steering.stop == Stop("by hand")
    source.stopped = None
    assert steering.stop == Stop("by hand")
    source.stopped = Stop("again", damp=True)
    assert steering.stop == Stop("again", damp=True)
