"""moteus' register protocol on CAN FD: identifiers, subframes, and frames of a command and its reply.

An identifier of 16 bits is `source << 8 | destination`; the highest bit requests a reply. A frame contains
subframes and is padded with NOP. A subframe writes, reads or reports some registers of one number type:

| byte | content |
| --- | --- |
| 0 | 0x00 write, 0x10 read, 0x20 reply; plus 0, 4, 8, 12: int8, int16, int32, float; plus a count up to 3 |
| next | the count, unless byte 0 has it |
| next | first register, a number in 7-bit groups, the least significant first |
| rest | values, little-endian; none in a read |

Source: moteus' documents "CAN Protocol" and "Register Reference". Positions are turns of the output shaft.
Two of its documents disagree on a command with only damping: in the register reference the scale of kd is
limited to that of kp, in the guide to control modes a kp scale of 0 gives velocity control. This code
follows the guide.
"""

import struct
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from footfall.deploy.frames import EXTENDED, FD

MODEL = "moteus"
HOST = 0x7D  # address of this host: with it no reply has an identifier of an IMU or a foot sensor
REPLY_ASKED = 0x80
NOP = 0x50
SIZES = np.array([*range(9), 12, 16, 20, 24, 32, 48, 64])  # possible lengths of a CAN FD frame, bytes

WRITE, READ, REPLY = 0x00, 0x10, 0x20
TYPES = {0: "<b", 4: "<h", 8: "<i", 12: "<f"}

MODE, POSITION_COMMAND, TORQUE_LIMIT, TIMEOUT, OUTPUT_EXACT = 0x000, 0x020, 0x025, 0x027, 0x131
STOPPED, FAULT, POSITION, TIMED_OUT = 0, 1, 10, 11  # values of MODE
TIMEOUT_UNIT_S = 0.001  # unit of an int16

QUERY = bytes.fromhex("11 00 1f 01 13 0d")  # mode; position, velocity, torque; voltage, temperature, fault
STOP = bytes.fromhex("01 00 00") + QUERY
ZERO = bytes.fromhex("0d b1 02 00 00 00 00") + QUERY  # sets the current position to 0.0
# Position mode; six floats from 0x020 on (position, velocity, torque, scales of kp and kd, torque limit; with
# NaN the drive keeps its own limit), a timeout; no limits of velocity and acceleration; no integral term.
COMMAND_HEAD, COMMAND_TIMEOUT = bytes.fromhex("01 00 0a 0c 06 20"), bytes.fromhex("05 27")
COMMAND_TAIL = bytes.fromhex("02 28 ff ff 01 2b 00") + QUERY
FLOATS = slice(len(COMMAND_HEAD), len(COMMAND_HEAD) + 20)  # in a command

REPLY_HEADS = {0: 0x21, 1: 0x00, 3: 0x2F, 4: 0x01, 17: 0x23, 18: 0x0D}  # constant bytes of each reply
REPLY_BYTES, REPLY_LENGTH = 22, 24  # without and with padding
VOLTAGE_UNIT = 0.5

FAULTS = {
    32: "a calibration fault",
    33: "a fault of its driver chip",
    34: "over-voltage",
    35: "an encoder fault",
    36: "that it is not calibrated",
    37: "a cycle overrun",
    38: "over-temperature",
    39: "a position outside its limits",
    40: "under-voltage",
    41: "that its configuration changed",
    42: "that it has no valid commutation encoder",
    43: "that it has no valid output encoder",
    44: "that its driver chip cannot be enabled",
    45: "a stop position beside limits",
    46: "a timing violation",
    47: "a feedforward without acceleration limit",
    48: "invalid position limits",
}


class Subframe(NamedTuple):
    """Registers to write or read, or reported registers."""

    kind: int  # WRITE, READ or REPLY
    first: int  # register
    registers: int  # number of registers
    form: str  # number type as a `struct` format
    values: tuple[float, ...]  # raw numbers; empty for a read


def subframes(data: bytes) -> Iterator[Subframe]:
    """Subframes of a frame.

    Raises:
        ValueError: the content is not this protocol, or is truncated.
    """
    at = 0

    def number() -> int:
        nonlocal at
        value, shift = 0, 0
        while True:
            byte = data[at]
            at, value, shift = at + 1, value | (byte & 0x7F) << shift, shift + 7
            if byte < 0x80:
                return value

    try:
        while at < len(data):
            head = data[at]
            at += 1
            if head == NOP:
                continue
            kind, form = head & 0x70, TYPES[head & 0x0C]
            if kind not in (WRITE, READ, REPLY):
                raise ValueError(f"no subframe {head:#04x}")
            count = head & 3 or number()
            first, values = number(), ()
            if kind != READ:
                layout = f"<{count}{form[1]}"
                values = struct.unpack_from(layout, data, at)
                at += struct.calcsize(layout)
            yield Subframe(kind, first, count, form[1], values)
    except (IndexError, struct.error):
        raise ValueError("a subframe is truncated") from None


def to_motor(motor_id: np.ndarray) -> np.ndarray:
    """Identifiers of frames to motors that request a reply."""
    return (REPLY_ASKED | HOST) << 8 | motor_id | EXTENDED | FD


def from_motor(motor_id: np.ndarray) -> np.ndarray:
    """Identifiers of replies: extended only if 11 bits are not enough."""
    short = motor_id << 8 | HOST
    return np.where(short < 0x800, short, short | EXTENDED) | FD


def padded(content: bytes, count: int) -> tuple[np.ndarray, int]:
    """Content as data of `count` frames, (count, 64) uint8, and the length with NOPs."""
    length = int(SIZES[np.searchsorted(SIZES, len(content))])
    row = np.frombuffer(content.ljust(length, bytes([NOP])).ljust(64, b"\0"), np.uint8)
    return np.tile(row, (count, 1)), length


def limit_access(highest: float | None) -> bytes:
    """Content that reads the torque limit, N m, after writing it unless `highest` is None.

    A write without a mode has no effect by itself: each command writes the limit again.
    """
    write = b"" if highest is None else bytes([0x0D, TORQUE_LIMIT]) + struct.pack("<f", highest)
    return write + bytes([0x1D, TORQUE_LIMIT])


def reported_limit(data: bytes) -> float | None:
    """Torque limit in a reply to `limit_access`, N m; None for other frames."""
    if data[:2] != bytes([0x2D, TORQUE_LIMIT]) or len(data) < 6:
        return None
    return float(struct.unpack_from("<f", data, 2)[0])


def command_rows(timeout_s: np.ndarray, torque_limit: np.ndarray) -> tuple[np.ndarray, int]:
    """Data of command frames with zeros instead of floats, (n, 64), and their length."""
    rows, length = [], 0
    counts = np.rint(timeout_s / TIMEOUT_UNIT_S).astype(int).tolist()
    for count, highest in zip(counts, torque_limit.tolist(), strict=True):
        floats = bytes(20) + struct.pack("<f", highest)
        content = COMMAND_HEAD + floats + COMMAND_TIMEOUT + struct.pack("<h", count) + COMMAND_TAIL
        row, length = padded(content, 1)
        rows.append(row)
    return np.concatenate(rows), length
