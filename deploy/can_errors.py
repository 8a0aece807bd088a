"""Faults of a bus by CAN error frames and by its controller's state.

A controller counts errors. Beyond 127 it is error-passive: it may no longer disturb others. That takes
milliseconds where no other node acknowledges (unplugged cable, no power, another bit rate). Beyond 255 it is
bus-off and sends nothing more. A robot cannot be driven in either state.
"""

# The identifier of SocketCAN's error frames is a set of classes, <linux/can/error.h>.
CONTROLLER, NO_ACKNOWLEDGE, BUS_OFF = 0x004, 0x020, 0x040
# In byte 1 of class CONTROLLER:
OVERFLOW, PASSIVE = 0x03, 0x30

PASSIVE_TEXT = "is error-passive: is another node on it, powered, terminated, at the same bit rate?"
BUS_OFF_TEXT = "is bus-off: its controller gave up after too many errors"


def meaning(identifier: int, data: bytes) -> str:
    """The fault that an error frame of SocketCAN reports; empty if the bus still works."""
    if identifier & BUS_OFF:
        return BUS_OFF_TEXT
    if identifier & CONTROLLER and len(data) > 1:
        if data[1] & PASSIVE:
            return PASSIVE_TEXT
        if data[1] & OVERFLOW:
            return "lost frames: its controller's buffer overflowed"
    return ""


def meaning_of_state(state: str) -> str:
    """The fault of a controller's state by python-can's name: ACTIVE, PASSIVE or ERROR (bus-off)."""
    return {"PASSIVE": PASSIVE_TEXT, "ERROR": BUS_OFF_TEXT}.get(state, "")
