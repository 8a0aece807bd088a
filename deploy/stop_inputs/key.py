"""A key of a Linux input device that stops the robot."""

import fcntl
import os
import struct
from contextlib import suppress

from footfall.common.errors import UserError
from footfall.deploy.command_source import Stop
from footfall.robots.stop_inputs import StopKey

# From <linux/input.h>
EVENT = struct.Struct("@llHHi")  # struct input_event: s, us, type, code, value
EV_KEY, RELEASED = 1, 0
KEYS = 0x300  # number of codes
EVIOCGRAB = 0x4004_4590  # exclusive access: the device's key presses reach no other program
EVIOCGKEY = 2 << 30 | KEYS // 8 << 16 | ord("E") << 8 | 0x18  # state of all keys, one bit each
EVENTS_PER_READ = 64  # events per read


class StopKeyInput:
    """The key, as a `StopSource`. Reading does not block. Removing the device stops the robot, too."""

    def __init__(self, key: StopKey) -> None:
        """Open the device.

        Raises:
            UserError: it cannot be opened, or the key is pressed.
        """
        self._key = key
        self._stop: Stop | None = None
        try:
            self._file = os.open(key.device, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            hint = ": add the user to the group `input`" if isinstance(error, PermissionError) else ""
            raise UserError(f"cannot open the stop key {key.device}: {error.strerror}{hint}") from None
        if self._is_down():
            self.close()
            raise UserError(f"the stop key {key.device} is pressed: release it first")
        with suppress(OSError):  # some devices do not support this
            fcntl.ioctl(self._file, EVIOCGRAB, 1)

    @property
    def stopped(self) -> Stop | None:
        if self._stop is None:
            self._read_events()
        return self._stop

    def _read_events(self) -> None:
        try:
            content = os.read(self._file, EVENTS_PER_READ * EVENT.size)
        except BlockingIOError:
            return
        except OSError:
            content = b""
        size = len(content) // EVENT.size * EVENT.size
        if not size:
            self._stop = self._stopped_by(f"the stop key {self._key.device} is gone")
        for _, _, kind, code, value in EVENT.iter_unpack(content[:size]):
            if kind == EV_KEY and value != RELEASED and self._key.code in (None, code):
                self._stop = self._stopped_by(f"stopped by key {code} of {self._key.device}")

    def _stopped_by(self, reason: str) -> Stop:
        return Stop(reason, self._key.damp, f"the stop key {self._key.device}")

    def _is_down(self) -> bool:
        bits = bytearray(KEYS // 8)
        try:
            fcntl.ioctl(self._file, EVIOCGKEY, bits)
        except OSError:  # not an input device of the kernel
            return False
        code = self._key.code
        return any(bits) if code is None else bool(bits[code // 8] >> code % 8 & 1)

    def close(self) -> None:
        os.close(self._file)
