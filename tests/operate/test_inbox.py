"""Requests of operators: the owner of control, refusals, silence, stops, and another source's run."""

import math

import numpy as np
import pytest
from fake_time import Watch
from walking_run import OFFER, WALKING

from footfall.deploy.command_source import Behaviour, Scheduled
from footfall.deploy.modes import Mode
from footfall.operate.accompanied import Accompanied
from footfall.operate.inbox import Inbox, InboxConfig

STANDING = WALKING._replace(mode=Mode.STANDING)


@pytest.fixture
def watch() -> Watch:
    return Watch()


@pytest.fixture
def inbox(watch: Watch) -> Inbox:
    inbox = Inbox(InboxConfig(still_after_s=0.5, lie_down_after_s=3.0), watch)
    inbox.poll(STANDING)
    return inbox


def test_the_longest_silence_between_two_goals_can_be_set(inbox: Inbox, watch: Watch) -> None:
    inbox.set_longest_silence(100.0)
    assert inbox.put("nav2", velocity=[0.1, 0, 0]) == ""
    inbox.poll(WALKING)
    watch.now_s += 99.0
    assert inbox.poll(WALKING).behaviour is Behaviour.WALK
    assert not inbox.poll(WALKING).velocity.any()
    watch.now_s += 1.0
    assert inbox.poll(WALKING).behaviour is Behaviour.LIE_DOWN


def test_a_new_value_replaces_only_the_previous_value_of_its_kind(inbox: Inbox) -> None:
    assert inbox.put("page", velocity=[0.1, 0, 0], settings={"step_height_m": 0.03}) == ""
    assert inbox.put("page", velocity=(0.5, 0.1, -0.2), policy="stand") == ""
    assert inbox.put("page", gait="wave") == ""
    request = inbox.poll(WALKING)
    assert request.velocity.tolist() == [0.5, 0.1, -0.2]
    assert (request.policy, request.gait, request.settings) == ("stand", "wave", {"step_height_m": 0.03})


def test_getting_up_is_requested_after_each_fall_or_refused(inbox: Inbox) -> None:
    assert "--recover" in inbox.put("page", behaviour="get_up")
    offer = OFFER._replace(get_up="up")
    inbox.poll(STANDING._replace(offer=offer))
    assert inbox.put("page", behaviour="get_up") == ""
    fallen = STANDING._replace(mode=Mode.FALLING, offer=offer)
    assert inbox.poll(fallen).behaviour is Behaviour.GET_UP
    assert inbox.poll(WALKING._replace(offer=offer)).behaviour is Behaviour.WALK
    assert inbox.poll(fallen).behaviour is Behaviour.WALK


def test_a_bad_request_is_refused_in_one_line_and_changes_nothing(inbox: Inbox) -> None:
    inbox.put("page", velocity=[0.1, 0, 0])
    before = inbox.poll(WALKING)
    velocities = [math.nan, 0, 0], [0.1, 0.2], "fast", {"x": 1}, [True, 0, 0], ["0.3", "0", "0"]
    heights = math.inf, math.nan, 10**400, True, "0.1"
    for wrong in (
        *({"velocity": velocity} for velocity in (*velocities, [10**400, 0, 0], [1e9, 0, 0])),
        *({"behaviour": "fly"}, {"behaviour": []}, {"policy": "mpc"}, {"policy": 7}, {"gait": "bound"}),
        *({"settings": {"step_height_m": height}} for height in heights),
        *({"settings": {"weight": 1.0}}, {"settings": {3: 1.0}}, {"settings": [0.1]}),
    ):
        assert "\n" not in inbox.put("page", **({"velocity": [0.9, 0, 0]} | wrong)) != "", wrong
        assert inbox.poll(WALKING) is before, wrong


def test_one_operator_steers_until_another_takes_over(inbox: Inbox) -> None:
    inbox.put("keys", velocity=[0.3, 0, 0])
    assert "keys" in inbox.put("page", velocity=[0.9, 0, 0])
    assert inbox.poll(WALKING).velocity[0] == 0.3
    assert inbox.take_over("page") == ""
    assert inbox.poll(WALKING).velocity[0] == 0.0  # until the new owner requests a velocity
    assert inbox.put("keys", velocity=[0.3, 0, 0])
    assert inbox.put("page", velocity=[0.9, 0, 0]) == ""
    request = inbox.poll(WALKING)
    assert (request.owner, request.velocity[0]) == ("page", 0.9)
    assert inbox.release("keys")
    assert inbox.release("page") == ""
    assert (inbox.owner, inbox.poll(WALKING).owner, inbox.poll(WALKING).velocity[0]) == ("", "", 0.0)


def test_a_silent_operator_stops_the_robot_and_later_lays_it_down(inbox: Inbox, watch: Watch) -> None:
    inbox.put("page", velocity=[0.4, 0, 0])
    watch.now_s += 0.49
    assert inbox.poll(WALKING).velocity[0] == 0.4
    watch.now_s += 0.02
    assert inbox.poll(WALKING).velocity[0] == 0.0
    inbox.put("page", velocity=[0.2, 0, 0])
    assert inbox.poll(WALKING).velocity[0] == 0.2
    watch.now_s += 3.01
    end = inbox.poll(WALKING)
    assert (end.behaviour, end.velocity[0], end.owner) == (Behaviour.LIE_DOWN, 0.0, "")  # by the run itself
    assert "page" in end.note
    inbox.put("page", velocity=[0.2, 0, 0])
    assert inbox.poll(WALKING).behaviour is Behaviour.LIE_DOWN


def test_anyone_stops_the_robot_and_stopping_again_damps_it(inbox: Inbox) -> None:
    inbox.put("page", velocity=[0.4, 0, 0])
    assert inbox.stopped is None
    inbox.stop("watcher", "child ahead\nrun")
    stop = inbox.stopped
    assert (stop.by, stop.damp, "\n" in stop.reason) == ("watcher", False, False)
    assert "watcher" in stop.reason
    inbox.stop("watcher")
    assert inbox.stopped.damp


def test_beside_another_source_operators_see_and_stop_the_run_but_do_not_steer_it() -> None:
    inbox = Inbox()
    source = Accompanied(Scheduled(lambda _: np.array([0.3, 0.0, 0.0])), inbox)
    inbox.take_over("page")
    inbox.put("page", velocity=[-0.5, 0.0, 0.0])
    assert source.poll(WALKING).velocity.tolist() == [0.3, 0.0, 0.0]
    assert inbox.status is WALKING
    assert source.stopped is None
    inbox.stop("page")
    assert source.stopped is not None
