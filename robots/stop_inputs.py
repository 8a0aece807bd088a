"""Devices that stop a robot, as declared in `robot.yaml`."""

from dataclasses import dataclass

from footfall.common.config import require_between

MAX_ID, MAX_EXTENDED_ID = 0x7FF, 0x1FFF_FFFF


@dataclass(frozen=True)
class StopFrame:
    """A CAN frame that stops the robot if it is empty or its first byte is not 0."""

    bus: str  # one of the robot's buses
    id: int
    extended: bool = False  # identifier of 29 bits
    heartbeat_s: float | None = None  # longest time without this frame; None: no limit
    damp: bool = False  # damp the joints at once instead of lying down first

    def __post_init__(self) -> None:
        require_between(self, 0, MAX_EXTENDED_ID if self.extended else MAX_ID, "id")
        require_between(self, 0.01, 10.0, "heartbeat_s")


@dataclass(frozen=True)
class StopKey:
    """A key of a Linux input device: a USB button, a remote's key, a GPIO line by the kernel's gpio-keys."""

    device: str  # such as /dev/input/by-id/usb-NAME-event-kbd
    code: int | None = None  # key code as in <linux/input-event-codes.h>; None: any key
    damp: bool = False  # damp the joints at once instead of lying down first

    def __post_init__(self) -> None:
        require_between(self, 0, 0x2FF, "code")


@dataclass(frozen=True)
class StopInputs:
    """All stop inputs of a robot."""

    frame: StopFrame | None = None
    key: StopKey | None = None
