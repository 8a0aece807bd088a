"""Keys of a terminal steer a run; afterwards the terminal's settings are restored."""

import os
import pty
import termios
import time

import pytest
from walking_run import WALKING, abilities, polled_until

from footfall.common.errors import UserError
from footfall.deploy.command_source import Status
from footfall.operate.inbox import Inbox
from footfall.operate.keyboard import Keyboard, KeyboardConfig, steered_by_keyboard
from footfall.operate.operator import Operator
from footfall.policies.live_settings import Applied

QUICK = KeyboardConfig(speed_share=0.5, first_s=1.0, again_s=0.1, rate_hz=100.0)


def keyboard_of(inbox: Inbox, config: KeyboardConfig, status: Status = WALKING) -> Keyboard:
    inbox.poll(status)
    return Keyboard(Operator("keyboard", inbox, abilities), config)


def test_a_key_is_held_for_as_long_as_it_is_repeated() -> None:
    inbox = Inbox()
    keyboard = keyboard_of(inbox, KeyboardConfig(1.0, first_s=0.7, again_s=0.2))
    for keys, now_s, velocity in (
        ("w", 0.0, 1.0),
        ("", 0.6, 1.0),  # a terminal repeats after a delay
        ("w", 0.65, 1.0),
        ("", 0.8, 1.0),
        ("", 0.9, 0.0),
        ("s", 1.0, -0.5),
        ("w", 1.1, 1.0),  # the last key counts
        (" ", 1.2, 0.0),
    ):
        keyboard.press(list(keys), now_s)
        keyboard.request_velocity(now_s)
        assert inbox.poll(WALKING).velocity[0] == velocity, now_s


def test_keys_move_the_robot_and_silence_stops_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp())  # the tests' process does not control it
    person, program = pty.openpty()  # ends of a terminal
    before, inbox = termios.tcgetattr(program), Inbox()
    inbox.poll(WALKING)
    with steered_by_keyboard(inbox, abilities, QUICK, program):
        os.write(person, b"w")
        assert polled_until(inbox, lambda r: r.velocity.any()).velocity.tolist() == [0.5, 0.0, 0.0]
        polled_until(inbox, lambda r: not r.velocity.any())
        os.write(person, b"\x1b[")
        time.sleep(0.02)
        os.write(person, b"D")  # the rest of an arrow key that came in two parts
        assert polled_until(inbox, lambda r: r.velocity.any()).velocity.tolist() == [0.0, 0.0, 0.4]
        os.write(person, b"s ")
        polled_until(inbox, lambda r: not r.velocity.any())
        os.write(person, b"\x00\xff\x1b[99~gr-e")
        request = polled_until(inbox, lambda r: r.velocity.any())
        assert (request.gait, request.settings) == ("trot", {"body_height_m": pytest.approx(0.26)})
        assert request.velocity.tolist() == pytest.approx([0.4, 0.0, -0.32])
        assert inbox.stopped is None
        os.write(person, b"x")
        polled_until(inbox, lambda _: inbox.stopped)
    assert termios.tcgetattr(program) == before
    os.close(person)
    os.close(program)


def test_keys_change_the_gait_from_the_one_that_the_robot_has() -> None:
    offer = WALKING.offer._replace(gaits=("trot", "ripple", "wave"))
    inbox, status = Inbox(), WALKING._replace(offer=offer, applied=Applied("ripple"))
    keyboard = keyboard_of(inbox, QUICK, status)
    for expected in ("wave", "trot", "ripple"):  # the second key comes before the first change is complete
        keyboard.press(["g"], 0.0)
        assert inbox.poll(status).gait == expected


def test_input_that_is_not_a_terminal_is_refused() -> None:
    with open(os.devnull, encoding="utf-8") as file:
        refused = pytest.raises(UserError)
        with refused, steered_by_keyboard(Inbox(), abilities, QUICK, file.fileno()):
            pass
