"""Reads single keys from a terminal, without echo; afterwards the terminal's settings are restored."""

import os
import re
import select
import termios
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from footfall.common.errors import UserError

MAX_BYTES = 256  # maximum per read
_ARROWS = {b"A": "up", b"B": "down", b"C": "right", b"D": "left"}
_KEY = re.compile(rb"\x1b[\[O]([A-D])|\x1b[\[O][0-9;]*[@-~]|\x1b|(.)", re.DOTALL)
_INCOMPLETE = re.compile(rb"\x1b([\[O][0-9;]*)?\Z")  # incomplete sequence


@contextmanager
def key_by_key(terminal: int) -> Iterator[None]:
    """Make a terminal deliver each key at once. Ctrl-C still interrupts; Ctrl-Z does not suspend.

    A suspended process would leave a robot without commands.

    Args:
        terminal: file descriptor.

    Raises:
        UserError: it is not a terminal, or this process is in its background.
    """
    try:
        before = termios.tcgetattr(terminal)
        in_foreground = os.tcgetpgrp(terminal) == os.getpgrp()
    except (OSError, termios.error):
        raise UserError("--from keyboard needs a terminal, but standard input is not one") from None
    if not in_foreground:
        raise UserError("--from keyboard needs the terminal's foreground: start it without '&'")
    mode = [*before[:6], list(before[6])]
    mode[3] &= ~(termios.ICANON | termios.ECHO)
    mode[6][termios.VMIN], mode[6][termios.VTIME] = 1, 0
    mode[6][termios.VSUSP] = os.fpathconf(terminal, "PC_VDISABLE")
    try:
        termios.tcsetattr(terminal, termios.TCSANOW, mode)
        yield
    finally:
        with suppress(termios.error):  # the terminal is gone
            termios.tcsetattr(terminal, termios.TCSAFLUSH, before)  # discards typed keys


class Keys:
    """Reads keys from a file descriptor."""

    def __init__(self, terminal: int) -> None:
        self._terminal, self._rest = terminal, b""
        self.open = True  # False when the terminal is gone

    def read(self, wait_s: float) -> list[str]:
        """Pressed keys, waiting at most `wait_s`: characters, and names of arrows."""
        try:
            if not select.select([self._terminal], [], [], wait_s)[0]:
                return []
            content = os.read(self._terminal, MAX_BYTES)
        except OSError:
            content = b""
        if not content:
            self.open = False
            return []
        content = self._rest + content
        incomplete = _INCOMPLETE.search(content)
        self._rest = content[incomplete.start() :] if incomplete else b""
        complete = content[: incomplete.start()] if incomplete else content
        return [key for found in _KEY.finditer(complete) if (key := _name(found))]


def _name(found: re.Match[bytes]) -> str:
    arrow, character = found.groups()
    return _ARROWS[arrow] if arrow else (character or b"").decode("ascii", "ignore")
