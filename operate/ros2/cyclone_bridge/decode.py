"""Decodes the message types that a run subscribes to (CDR, DDS-XTypes 1.3, 7.4.1, version 1)."""

import struct
from typing import Any

from footfall.operate.ros2.table import TWIST, TWIST_STAMPED

HEAD = 4  # bytes before the message, from which alignment counts
STAMP = 8


def decode(kind: str, message: bytes) -> Any:
    """The value of a message: a velocity (3,), a text, a number, or None for one without content.

    Raises:
        ValueError: its bytes are no message of that kind.
    """
    order = "<" if message[1:2] == b"\x01" else ">"
    content = message[HEAD:]
    try:
        if kind in (TWIST, TWIST_STAMPED):
            start = 0 if kind == TWIST else _after_header(order, content)
            forward, leftward, _, _, _, yaw = struct.unpack_from(f"{order}6d", content, start)
            return [forward, leftward, yaw]
        if kind == "std_msgs/msg/String":
            (size,) = struct.unpack_from(f"{order}I", content)
            return content[4 : 4 + size].rstrip(b"\0").decode()
        if kind == "std_msgs/msg/Float64":
            return struct.unpack_from(f"{order}d", content)[0]
    except struct.error:
        raise ValueError(f"no message of {kind}") from None
    return None


def _after_header(order: str, content: bytes) -> int:
    """Offset of a float64 after a std_msgs/Header."""
    (size,) = struct.unpack_from(f"{order}I", content, STAMP)
    end = STAMP + 4 + int(size)
    return end + -end % 8
