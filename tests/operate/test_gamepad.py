"""A gamepad steers while its dead-man button is pressed; an unplugged gamepad sends nothing."""

import os
import struct
import time
from pathlib import Path

import pytest
from walking_run import WALKING, abilities, polled_until

from footfall.common.errors import UserError
from footfall.operate.gamepad import GamepadConfig, shaped, steered_by_gamepad
from footfall.operate.inbox import Inbox

BUTTON, AXIS, INITIAL = 1, 2, 0x80
DEAD_MAN, STOP, GAIT = 4, 1, 3


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


def test_a_missing_device_is_refused(tmp_path: Path) -> None:
    missing = GamepadConfig(str(tmp_path / "none"))
    with pytest.raises(UserError), steered_by_gamepad(Inbox(), abilities, missing):
        pass
