"""Decodes messages of the subscribed types (CDR, DDS-XTypes 1.3, 7.4.1, version 1)."""

import struct
from typing import Any

from footfall.operate.ros2.table import HEIGHT_SCAN, TWIST, TWIST_STAMPED

HEADER_BYTES = 4  # size of the CDR header; alignment is relative to its end
STAMP_BYTES = 8  # size of the time stamp in a std_msgs/Header


def decode(kind: str, message: bytes) -> Any:
    """Content of a message: a velocity (3,), a text, a number, numbers, or None for an empty message.

    Raises:
        ValueError: the bytes are not a message of that kind.
    """
    order = "<" if message[1:2] == b"\x01" else ">"
    content = message[HEADER_BYTES:]
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
        if kind == HEIGHT_SCAN.kind:
            return _array(order, content)
    except struct.error:
        raise ValueError(f"not a message of type {kind}") from None
    return None


def _after_header(order: str, content: bytes) -> int:
    """Offset of a float64 after a std_msgs/Header."""
    (size,) = struct.unpack_from(f"{order}I", content, STAMP_BYTES)
    end = STAMP_BYTES + 4 + int(size)
    return end + -end % 8


def _array(order: str, content: bytes) -> list[float]:
    """Numbers of a std_msgs/Float32MultiArray, starting at its `data_offset`."""
    (dimensions,) = struct.unpack_from(f"{order}I", content)
    offset = 4
    for _ in range(dimensions):  # label, size, stride
        (size,) = struct.unpack_from(f"{order}I", content, offset)
        offset += 4 + int(size)
        offset += -offset % 4 + 8
    first, count = struct.unpack_from(f"{order}2I", content, offset)
    return list(struct.unpack_from(f"{order}{count}f", content, offset + 8)[first:])
