"""Bus faults from CAN error frames and from the controller's state.

A controller counts errors. Beyond 127 it is error-passive: it may no longer disturb other nodes. This takes
milliseconds if no other node acknowledges (unplugged cable, no power, another bit rate). Beyond 255 it is
bus-off and sends nothing. A robot cannot be controlled in either state.
"""

# The identifier of SocketCAN's error frames is a bit mask of classes, <linux/can/error.h>.
CONTROLLER, NO_ACKNOWLEDGE, BUS_OFF = 0x004, 0x020, 0x040
# Bits in byte 1 of class CONTROLLER:
OVERFLOW, PASSIVE = 0x03, 0x30

PASSIVE_TEXT = "is error-passive: check that another node is on it, powered, terminated, at the same bit rate"
BUS_OFF_TEXT = "is bus-off: its controller shut down after too many errors"


def meaning(identifier: int, data: bytes) -> str:
    """Fault reported by an error frame of SocketCAN; empty if the bus still works."""
    if identifier & BUS_OFF:
        return BUS_OFF_TEXT
    if identifier & CONTROLLER and len(data) > 1:
        if data[1] & PASSIVE:
            return PASSIVE_TEXT
        if data[1] & OVERFLOW:
            return "lost frames: its controller's buffer overflowed"
    return ""


def meaning_of_state(state: str) -> str:
    """Fault for a controller's state by python-can's name: ACTIVE, PASSIVE or ERROR (bus-off)."""
    return {"PASSIVE": PASSIVE_TEXT, "ERROR": BUS_OFF_TEXT}.get(state, "")
