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
        self._down: set[int] = set()

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
        self._down.clear()

    def axis(self, number: int) -> float:
        """Position of an axis; 0 while unknown."""
        return self._axes.get(number, 0.0)

    def down(self, button: int) -> bool:
        """Whether a button is pressed."""
        return button in self._down

    def read(self, wait_s: float) -> list[int]:
        """Read all events, waiting for the first one; returns newly pressed buttons.

        An unplugged device is closed.
        """
        pressed: list[int] = []
        try:
            if select.select([self._file], [], [], wait_s)[0]:
                content = os.read(self._file, EVENT.size * MAX_EVENTS)
                if not content:
                    raise OSError("the device is gone")
                for _, value, kind, number in EVENT.iter_unpack(
                    content[: len(content) // EVENT.size * EVENT.size]
                ):
                    pressed += self._take(kind, number, value)
        except OSError:
            self.close()
        return pressed

    def _take(self, kind: int, number: int, value: int) -> list[int]:
        if kind & ~INITIAL == AXIS:
            self._axes[number] = max(value / AXIS_LIMIT, -1.0)
        elif kind & ~INITIAL == BUTTON:
            if value and not kind & INITIAL:  # a button held when the device is opened has no effect
                self._down.add(number)
                return [number]
            self._down.discard(number)
        return []
