"""Control by the keys of a terminal, also over ssh.

A terminal reports when a key is pressed, but not when it is released. While a key is held, the keyboard
repeats it, after an initial delay. So a key counts as held for `first_s` after it was pressed and for
`again_s` after each repetition; then the robot stands. Only the last pressed key is repeated: there is one
key at a time, and two keys combine walking ahead with turning.
"""

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from footfall.common.config import require_between
from footfall.deploy.command_source import Behaviour
from footfall.operate.abilities import Abilities
from footfall.operate.inbox import Inbox
from footfall.operate.open_source import OpenSource
from footfall.operate.operator import ZERO_MOTION, Operator
from footfall.operate.terminal_keys import Keys, key_by_key

NAME = "keyboard"
STDIN = 0
JOIN_S = 1.0
MOTIONS = {  # forward, leftward, yaw as shares
    "w": (1.0, 0.0, 0.0),
    "s": (-1.0, 0.0, 0.0),
    "a": (0.0, 0.0, 1.0),
    "d": (0.0, 0.0, -1.0),
    "q": (1.0, 0.0, 1.0),
    "e": (1.0, 0.0, -1.0),
    "z": (0.0, 1.0, 0.0),
    "c": (0.0, -1.0, 0.0),
}
ARROWS = {"up": "w", "down": "s", "left": "a", "right": "d"}
HELP = (
    "w s ahead and back, a d turn, q e ahead and turn, z c sideways (hold the key); space stands",
    "+ - speed, g next gait, p next policy, r f body up and down, t take over, l lie down, u get up, x STOP",
)


@dataclass(frozen=True)
class KeyboardConfig:
    """Settings of keyboard control."""

    speed_share: float = 0.5  # initial speed, relative to the policy's maximum commands
    speed_step: float = 0.1
    height_step_m: float = 0.01
    first_s: float = 0.7  # longer than the keyboard's delay before the first repetition
    again_s: float = 0.25  # longer than the interval between repetitions plus the network's jitter
    rate_hz: float = 20.0  # of requests

    def __post_init__(self) -> None:
        require_between(self, 0.05, 1.0, "speed_share", "speed_step")
        require_between(self, 0.001, 0.1, "height_step_m")
        require_between(self, 0.05, 2.0, "first_s", "again_s")
        require_between(self, 5.0, 100.0, "rate_hz")


class Keyboard:
    """Translates keys into an operator's requests."""

    def __init__(self, operator: Operator, config: KeyboardConfig) -> None:
        self._operator, self._config = operator, config
        self._share = config.speed_share
        self._held, self._held_until_s = "", 0.0
        up_m = config.height_step_m
        self._actions: dict[str, Callable[[], None]] = {
            " ": self._release,
            "+": partial(self._change_speed, config.speed_step),
            "=": partial(self._change_speed, config.speed_step),  # same key without shift
            "-": partial(self._change_speed, -config.speed_step),
            "g": operator.next_gait,
            "p": operator.next_policy,
            "r": partial(operator.raise_body, up_m),
            "f": partial(operator.raise_body, -up_m),
            "t": operator.take_over,
            "l": partial(operator.request, Behaviour.LIE_DOWN),
            "u": partial(operator.request, Behaviour.GET_UP),
            "x": operator.stop,
        }

    @property
    def line(self) -> str:
        """Text for a status line."""
        return ", ".join(filter(None, [f"keys at {self._share:.0%}", self._operator.line]))

    def press(self, keys: Sequence[str], now_s: float) -> None:
        """Handle keys in the order in which they were pressed or repeated."""
        for pressed in keys:
            key = ARROWS.get(pressed, pressed.lower())
            if key in MOTIONS:
                repeated = key == self._held
                held_until_s = now_s + (self._config.again_s if repeated else self._config.first_s)
                self._held_until_s = max(held_until_s, self._held_until_s) if repeated else held_until_s
                self._held = key
            elif key in self._actions:
                self._actions[key]()

    def request_velocity(self, now_s: float) -> None:
        """Request the velocity of the held key, or zero."""
        if now_s >= self._held_until_s:
            self._held = ""
        motion = MOTIONS.get(self._held, ZERO_MOTION)
        self._operator.move([self._share * share for share in motion])

    def _release(self) -> None:
        self._held = ""

    def _change_speed(self, change: float) -> None:
        self._share = min(max(self._share + change, self._config.speed_step), 1.0)


@contextmanager
def steered_by_keyboard(
    inbox: Inbox, abilities: Callable[[str], Abilities], config: KeyboardConfig, terminal: int = STDIN
) -> Iterator[OpenSource]:
    """Control by the keys of a terminal through the inbox, while the context is open.

    Raises:
        UserError: there is no terminal.
    """
    keyboard = Keyboard(Operator(NAME, inbox, abilities), config)
    keys, ended = Keys(terminal), threading.Event()

    def listen() -> None:
        while not ended.is_set() and keys.open:  # without a terminal the inbox times out
            pressed = keys.read(1.0 / config.rate_hz)
            keyboard.press(pressed, time.monotonic())
            keyboard.request_velocity(time.monotonic())

    with key_by_key(terminal):
        thread = threading.Thread(target=listen, name=NAME, daemon=True)
        thread.start()
        try:
            yield OpenSource(inbox, lambda: keyboard.line, HELP)
        finally:
            ended.set()
            thread.join(JOIN_S)
