"""Reads a Linux joystick device such as `/dev/input/js0` (kernel: input/joydev/joystick-api.rst)."""

import os
import select
import struct

EVENT = struct.Struct("=IhBB")  # time in ms, value, type, number
BUTTON, AXIS, INITIAL = 0x01, 0x02, 0x80
AXIS_LIMIT = 32767  # value of an axis at its limit
MAX_EVENTS = 64  # maximum number per read


class Joystick:
    """Axes from -1 to 1, and buttons, of a device that may be unplugged and plugged in."""

    def __init__(self, path: str) -> None:
        self._path, self._file = path, -1
        self._axes: dict[int, float] = {}
        self._pressed: set[int] = set()

    @property
    def connected(self) -> bool:
        """Whether the device is open."""
        return self._file >= 0

    def open(self) -> None:
        """Open the device, unless it is open. Its first events report its state.

        Raises:
            OSError: it cannot be opened.
        """
        if not self.connected:
            self._file = os.open(self._path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)

    def close(self) -> None:
        """Close the device and forget pressed buttons."""
        if self.connected:
            os.close(self._file)
        self._file = -1
        self._axes.clear()
        self._pressed.clear()

    def axis(self, number: int) -> float:
        """Position of an axis; 0 while unknown."""
        return self._axes.get(number, 0.0)

    def pressed(self, button: int) -> bool:
        """Whether a button is pressed."""
        return button in self._pressed

    def read(self, wait_s: float) -> list[int]:
        """Read all events, waiting for the first one; returns newly pressed buttons.

        An unplugged device is closed.
        """
        newly_pressed: list[int] = []
        try:
            if select.select([self._file], [], [], wait_s)[0]:
                content = os.read(self._file, EVENT.size * MAX_EVENTS)
                if not content:
                    raise OSError("the device is gone")
                for _, value, kind, number in EVENT.iter_unpack(
                    content[: len(content) // EVENT.size * EVENT.size]
                ):
                    newly_pressed += self._take(kind, number, value)
        except OSError:
            self.close()
        return newly_pressed

    def _take(self, event_type: int, number: int, value: int) -> list[int]:
        if event_type & ~INITIAL == AXIS:
            self._axes[number] = max(value / AXIS_LIMIT, -1.0)
        elif event_type & ~INITIAL == BUTTON:
            if value and not event_type & INITIAL:  # a button held when the device is opened has no effect
                self._pressed.add(number)
                return [number]
            self._pressed.discard(number)
        return []
