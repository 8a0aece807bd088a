"""Motors are disabled until each has answered, whatever happened before."""

import numpy as np
from deploy_policies import Hold
from frame_robot import FrameRobot
from loops import loop_of, until

from footfall.deploy.last_resort import DISABLE_TIMEOUT_US
from footfall.deploy.loop import ControlLoop
from footfall.deploy.modes import Mode
from footfall.plant.motor_ends.motor_end import Request
from footfall.robots.description import Robot


def shut_down(loop: ControlLoop, body: FrameRobot, silent: list[int]) -> list[int]:
    """Times of the frames sent while a walking robot is shut down, us from the beginning."""
    until(loop, Mode.WALKING)
    sent, body.silent = len(body.sent), silent
    loop.shut_down()
    assert body.kinds() == [Request.DISABLE] * 12
    return [at_us - loop.now_us for at_us, _ in body.sent[sent:]]


def test_a_motor_that_never_replies_is_named_after_a_quarter_of_a_second(go1: Robot) -> None:
    loop, body = loop_of(go1, Hold(go1))
    assert shut_down(loop, body, silent=[7]) == np.arange(2000, DISABLE_TIMEOUT_US + 4000, 2000).tolist()
    assert loop.last_resort.silent_at_the_end == ["RR_thigh_joint (can2, id 2)"]
    assert loop.last_resort.on_at_the_end == []


def test_a_motor_that_replies_but_stays_enabled_is_named_at_the_timeout(go1: Robot) -> None:
    loop, body = loop_of(go1, Hold(go1))
    body.readings[2, 7] = 2.0
    assert shut_down(loop, body, silent=[]) == np.arange(2000, DISABLE_TIMEOUT_US + 4000, 2000).tolist()
    assert loop.last_resort.silent_at_the_end == []
    assert loop.last_resort.on_at_the_end == ["RR_thigh_joint (can2, id 2)"]
