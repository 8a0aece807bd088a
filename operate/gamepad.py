"""Control by a gamepad, through Linux's joystick device.

The robot moves only while the dead-man button is pressed. An unplugged device sends nothing: its last request
ages like any operator's, so the velocity becomes zero. A device that is plugged in again has an effect only
after the dead-man button has been pressed again.
"""

import math
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial

from footfall.common.config import require_between
from footfall.common.errors import UserError
from footfall.deploy.command_source import Behaviour
from footfall.operate.abilities import Abilities
from footfall.operate.inbox import Inbox
from footfall.operate.joystick import Joystick
from footfall.operate.open_source import OpenSource
from footfall.operate.operator import ZERO_MOTION, Operator

NAME = "gamepad"
JOIN_S = 1.0
RETRY_S = 0.5


@dataclass(frozen=True)
class Buttons:
    """Button numbers as shown by `jstest`; the defaults are those of an Xbox pad on Linux."""

    dead_man: int = 4  # left shoulder: the robot moves only while this is pressed
    stop: int = 1  # B: stop, latched; pressed again it damps
    lie_down: int = 6  # back
    stand: int = 0  # A
    walk: int = 2  # X
    take_over: int = 7  # start
    gait: int = 3  # Y: next gait


@dataclass(frozen=True)
class GamepadConfig:
    """Settings of a gamepad."""

    device: str = "/dev/input/js0"
    axes: tuple[int, int, int] = (1, 0, 3)  # forward, leftward, yaw: left stick, and right stick sideways
    dead_zone: float = 0.12  # of a stick's range; smaller values count as zero
    expo: float = 0.4  # share of a cubic curve, for fine control near the centre; 0 for none
    speed_share: float = 0.7  # maximum speed, relative to the policy's maximum commands
    rate_hz: float = 25.0  # of requests
    buttons: Buttons = field(default_factory=Buttons)

    def __post_init__(self) -> None:
        require_between(self, 0, 63, "axes")
        require_between(self, 0.0, 0.9, "dead_zone")
        require_between(self, 0.0, 1.0, "expo")
        require_between(self, 0.01, 1.0, "speed_share")
        require_between(self, 5.0, 100.0, "rate_hz")


def shaped(value: float, dead_zone: float, expo: float) -> float:
    """A stick's position from -1 to 1 after dead zone and expo, continuous at the zone's edge."""
    beyond = max(0.0, abs(value) - dead_zone) / (1.0 - dead_zone)
    return math.copysign(expo * beyond**3 + (1.0 - expo) * beyond, value)


class Gamepad:
    """Translates sticks and buttons into an operator's requests."""

    def __init__(self, operator: Operator, config: GamepadConfig) -> None:
        self._operator, self._config = operator, config
        self.joystick = Joystick(config.device)
        buttons = config.buttons
        self._actions: dict[int, Callable[[], None]] = {
            buttons.stop: operator.stop,
            buttons.lie_down: partial(operator.request, Behaviour.LIE_DOWN),
            buttons.stand: partial(operator.request, Behaviour.STAND),
            buttons.walk: partial(operator.request, Behaviour.WALK),
            buttons.take_over: operator.take_over,
            buttons.gait: operator.next_gait,
        }

    @property
    def line(self) -> str:
        """Text for a status line."""
        if not self.joystick.connected:
            return f"gamepad {self._config.device} is not connected"
        hint = "" if self._dead_man_pressed else f"hold button {self._config.buttons.dead_man} to move"
        return ", ".join(filter(None, ["gamepad", hint, self._operator.line]))

    def work(self, wait_s: float) -> None:
        """Read the device, and send the resulting requests."""
        for button in self.joystick.read(wait_s):
            if button in self._actions:
                self._actions[button]()
        if self.joystick.connected:  # an unplugged device requests nothing
            self._operator.move(
                [self._share(axis) for axis in self._config.axes] if self._dead_man_pressed else ZERO_MOTION
            )

    @property
    def _dead_man_pressed(self) -> bool:
        return self.joystick.pressed(self._config.buttons.dead_man)

    def _share(self, axis: int) -> float:
        """A stick's share of the maximum command; devices report forward and left as negative."""
        config = self._config
        return -config.speed_share * shaped(self.joystick.axis(axis), config.dead_zone, config.expo)


@contextmanager
def steered_by_gamepad(
    inbox: Inbox, abilities: Callable[[str], Abilities], config: GamepadConfig
) -> Iterator[OpenSource]:
    """Control by a gamepad through the inbox, while the context is open.

    Raises:
        UserError: the device does not exist.
    """
    pad, ended = Gamepad(Operator(NAME, inbox, abilities), config), threading.Event()
    try:
        pad.joystick.open()
    except OSError as error:
        why = f"{config.device}: {error.strerror or error}"
        raise UserError(f"--from gamepad: {why}; choose another one: --from gamepad:/dev/input/js1") from None

    def listen() -> None:
        while not ended.is_set():
            if pad.joystick.connected:
                pad.work(1.0 / config.rate_hz)
            elif not ended.wait(RETRY_S):
                with suppress(OSError):
                    pad.joystick.open()
        pad.joystick.close()

    thread = threading.Thread(target=listen, name=NAME, daemon=True)
    thread.start()
    about = (
        f"{config.device}: hold button {config.buttons.dead_man} to move, button {config.buttons.stop} STOPS"
    )
    try:
        yield OpenSource(inbox, lambda: pad.line, (about,))
    finally:
        ended.set()
        thread.join(JOIN_S)
