"""Devices that stop a robot from outside, as `robot.yaml` declares them."""

from dataclasses import dataclass

from footfall.common.config import require_between

LARGEST_ID, LARGEST_LONG_ID = 0x7FF, 0x1FFF_FFFF


@dataclass(frozen=True)
class StopFrame:
    """A CAN frame. It stops the robot if it is empty or its first byte is not 0."""

    bus: str  # one of the robot's
    id: int
    extended: bool = False  # identifier of 29 bits
    heartbeat_s: float | None = None  # longest time without this frame; None: silence is no stop
    damp: bool = False  # damp the joints at once instead of lying down first

    def __post_init__(self) -> None:
        require_between(self, 0, LARGEST_LONG_ID if self.extended else LARGEST_ID, "id")
        require_between(self, 0.01, 10.0, "heartbeat_s")


@dataclass(frozen=True)
class StopKey:
    """A key of a Linux input device: a USB button, a remote's key, a GPIO line by the kernel's gpio-keys."""

    device: str  # such as /dev/input/by-id/usb-NAME-event-kbd
    code: int | None = None  # of the key, as in <linux/input-event-codes.h>; None: any key
    damp: bool = False  # likewise

    def __post_init__(self) -> None:
        require_between(self, 0, 0x2FF, "code")


@dataclass(frozen=True)
class StopInputs:
    """All of them."""

    frame: StopFrame | None = None
    key: StopKey | None = None
