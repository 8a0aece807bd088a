"""Keys of a terminal and a gamepad steer a run; an unplugged gamepad sends nothing."""

import os
import pty
import struct
import termios
import time
from pathlib import Path

import pytest
from walking_run import WALKING, abilities, polled_until

from footfall.common.errors import UserError
from footfall.operate.gamepad import GamepadConfig, shaped, steered_by_gamepad
from footfall.operate.inbox import Inbox
from footfall.operate.keyboard import Keyboard, KeyboardConfig, steered_by_keyboard
from footfall.operate.operator import Operator
from footfall.policies.live_settings import Applied

BUTTON, AXIS, INITIAL = 1, 2, 0x80
DEAD_MAN, STOP, GAIT = 4, 1, 3
QUICK = KeyboardConfig(speed_share=0.5, first_s=1.0, again_s=0.1, rate_hz=100.0)


def test_a_key_is_held_for_as_long_as_it_is_repeated() -> None:
    inbox, config = Inbox(), KeyboardConfig(1.0, first_s=0.7, again_s=0.2)
    inbox.poll(WALKING)
    keyboard = Keyboard(Operator("keyboard", inbox, abilities), config)
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
    monkeypatch.setattr(os, "tcgetpgrp", lambda _: os.getpgrp())  # as if this process controlled the terminal
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
    inbox.poll(status)
    keyboard = Keyboard(Operator("keyboard", inbox, abilities), QUICK)
    for expected in ("wave", "trot", "ripple"):  # the second key comes before the first change is complete
        keyboard.press(["g"], 0.0)
        assert inbox.poll(status).gait == expected


class Device:
    """The kernel's end of a joystick device, replaced by a pipe."""

    def __init__(self, path: Path) -> None:
        self.path = path
        os.mkfifo(path)
        self.plug()

    def plug(self) -> None:
        reader = os.open(self.path, os.O_RDONLY | os.O_NONBLOCK)  # so that it opens for writing
        self._ends = os.open(self.path, os.O_WRONLY), reader

    def unplug(self) -> None:
        for end in self._ends:
            os.close(end)

    def send(self, *events: tuple[int, int, int]) -> None:
        """Events of (type, number, value)."""
        for kind, number, value in events:
            os.write(self._ends[0], struct.pack("=IhBB", 0, value, kind, number))


def test_a_gamepad_steers_with_its_dead_man_button_and_sends_nothing_when_unplugged(tmp_path: Path) -> None:
    device, inbox = Device(tmp_path / "js0"), Inbox()
    config = GamepadConfig(str(device.path), dead_zone=0.1, expo=0.0, speed_share=1.0, rate_hz=100.0)
    inbox.poll(WALKING)
    with steered_by_gamepad(inbox, abilities, config) as opened:
        device.send((BUTTON | INITIAL, DEAD_MAN, 1), (AXIS | INITIAL, 1, -32767))
        time.sleep(0.05)
        assert not inbox.poll(WALKING).velocity.any()  # pressed before the device was connected
        device.send((BUTTON, DEAD_MAN, 0), (BUTTON, DEAD_MAN, 1), (AXIS, 0, 32767), (AXIS, 3, 2000))
        request = polled_until(inbox, lambda r: r.velocity[1])
        assert request.velocity.tolist() == pytest.approx([1.0, -0.3, 0.0])
        device.send((BUTTON, GAIT, 1))
        polled_until(inbox, lambda r: r.gait == "trot")
        device.send((BUTTON, DEAD_MAN, 0))
        polled_until(inbox, lambda r: not r.velocity.any())
        device.send((BUTTON, DEAD_MAN, 1))
        polled_until(inbox, lambda r: r.velocity.any())
        device.unplug()
        polled_until(inbox, lambda r: not r.velocity.any())
        assert "not connected" in opened.line()
        device.plug()
        device.send((AXIS | INITIAL, 1, -32767), (BUTTON, DEAD_MAN, 1), (BUTTON, STOP, 1))
        polled_until(inbox, lambda r: r.velocity.any())
        assert inbox.stopped is not None
    device.unplug()


def test_dead_zone_and_expo_keep_ends_and_middle() -> None:
    for expo in (0.0, 0.5, 1.0):
        assert (shaped(1.0, 0.1, expo), shaped(-1.0, 0.1, expo)) == (1.0, -1.0)
        assert shaped(0.09, 0.1, expo) == shaped(-0.1, 0.1, expo) == 0.0
    assert 0.0 < shaped(0.5, 0.1, 0.5) < shaped(0.5, 0.1, 0.0) < 0.5


def test_a_missing_gamepad_and_a_file_as_terminal_are_refused(tmp_path: Path) -> None:
    missing = GamepadConfig(str(tmp_path / "none"))
    with pytest.raises(UserError), steered_by_gamepad(Inbox(), abilities, missing):
        pass
    with open(os.devnull, encoding="utf-8") as file:
        keyboard = steered_by_keyboard(Inbox(), abilities, QUICK, file.fileno())
        with pytest.raises(UserError), keyboard:
            pass
