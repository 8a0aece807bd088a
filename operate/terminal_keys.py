"""Keys of a terminal, one by one, without echo; the terminal is as before afterwards."""

import os
import re
import select
import termios
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from footfall.common.errors import UserError

MOST_BYTES = 256  # of one read
_ARROWS = {b"A": "up", b"B": "down", b"C": "right", b"D": "left"}
_KEY = re.compile(rb"\x1b[\[O]([A-D])|\x1b[\[O][0-9;]*[@-~]|\x1b|(.)", re.DOTALL)
_BEGUN = re.compile(rb"\x1b([\[O][0-9;]*)?\Z")  # the rest of a sequence may come later


@contextmanager
def key_by_key(terminal: int) -> Iterator[None]:
    """A terminal that hands over each key at once. Ctrl-C still interrupts; Ctrl-Z no longer suspends.

    A suspended process would leave a robot without commands.

    Args:
        terminal: file descriptor.

    Raises:
        UserError: it is no terminal, or one of which this process is in the background.
    """
    try:
        before = termios.tcgetattr(terminal)
        in_front = os.tcgetpgrp(terminal) == os.getpgrp()
    except (OSError, termios.error):
        raise UserError("--from keyboard needs a terminal: standard input is none") from None
    if not in_front:
        raise UserError("--from keyboard needs the terminal's foreground: start it without '&'")
    mode = [*before[:6], list(before[6])]
    mode[3] &= ~(termios.ICANON | termios.ECHO)
    mode[6][termios.VMIN], mode[6][termios.VTIME] = 1, 0
    mode[6][termios.VSUSP] = os.fpathconf(terminal, "PC_VDISABLE")
    try:
        termios.tcsetattr(terminal, termios.TCSANOW, mode)
        yield
    finally:
        with suppress(termios.error):  # a terminal that is gone
            termios.tcsetattr(terminal, termios.TCSAFLUSH, before)  # keys that were typed are no commands


class Keys:
    """Reads keys from a file descriptor."""

    def __init__(self, terminal: int) -> None:
        self._terminal, self._rest = terminal, b""
        self.open = True  # until the terminal is gone

    def read(self, wait_s: float) -> list[str]:
        """The keys that were pressed, after `wait_s` at most: characters, and names of arrows."""
        try:
            if not select.select([self._terminal], [], [], wait_s)[0]:
                return []
            content = os.read(self._terminal, MOST_BYTES)
        except OSError:
            content = b""
        if not content:
            self.open = False
            return []
        content = self._rest + content
        begun = _BEGUN.search(content)
        self._rest = content[begun.start() :] if begun else b""
        whole = content[: begun.start()] if begun else content
        return [key for found in _KEY.finditer(whole) if (key := _name(found))]


def _name(found: re.Match[bytes]) -> str:
    arrow, character = found.groups()
    return _ARROWS[arrow] if arrow else (character or b"").decode("ascii", "ignore")
