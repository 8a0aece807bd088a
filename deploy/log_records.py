"""Records in the pipe from the control loop to the process that writes its log."""

import struct
from collections.abc import Iterator
from enum import IntEnum

START = struct.Struct("<q")  # Unix time of time zero, ns: at the head of the first record
FRAME = struct.Struct("<qBBI8s")  # of a CAN frame: time us, bus, length, identifier of `Frames`, data
FD_FRAME = struct.Struct("<qBBI64s")  # of a CAN FD frame, likewise
HEAD = struct.Struct("<BIq")  # kind, bytes that follow, time in microseconds of the loop's clock


class Kind(IntEnum):
    """Content of a record. Numbers are float64, those of the network float32; n is the number of joints."""

    BEGIN = 0  # `START`, then JSON: joints, sizes of readings and inputs, metadata, links, URDF, file's name
    READINGS = 1  # the fields of `Sensed` in their order
    COMMANDED = 2  # (5n,) what went out: position, velocity, stiffness, damping, torque
    INPUTS = 3  # the policy's input: see `log_numbers.flatten`
    DECISION = 4  # (5n,) its decision
    OBSERVATION = 5  # the observation of its network
    ACTION = 6  # the action of its network
    STATE = 7  # text
    NOTE = 8  # text
    END = 9  # the run ended in order
    ODOMETRY = 10  # (85,) as a nav_msgs/Odometry has them
    CONTACTS = 11  # (feet,) probability that each stands
    AGES = 12  # (n + 1,) of each motor's reading and of the IMU's, s
    HEALTH = 13  # (3n,) temperatures, voltages, error codes
    FOOTHOLDS = 14  # (3 feet,) planned footholds, from the base, heading frame, m; NaN for a standing foot
    CHANGE = 15  # JSON: see `changes.Change`
    TIMING = 16  # (2,) work of a tick and its lateness, us; wall clock only
    BATTERY = 17  # (3,) voltage V, current A (negative: drawn), charge 0 to 1; NaN for unknown
    RECEIVED = 18  # CAN frames: for each, `FRAME`
    SENT = 19  # likewise
    RECEIVED_FD = 20  # CAN FD frames: for each, `FD_FRAME`
    SENT_FD = 21  # likewise
    ORDER = 22  # JSON: see `orders.Order`
    APPLIED = 23  # JSON: see `live_settings.Applied`


def record(kind: Kind, now_us: int, content: bytes = b"") -> bytes:
    """A record's bytes."""
    return HEAD.pack(kind, len(content), now_us) + content


def take_records(arrived: bytearray) -> Iterator[tuple[Kind, int, bytes]]:
    """Remove each whole record from `arrived`; yields its kind, time and content."""
    done = 0
    try:
        while len(arrived) - done >= HEAD.size:
            kind, size, now_us = HEAD.unpack_from(arrived, done)
            end = done + HEAD.size + size
            if len(arrived) < end:
                break
            content = bytes(arrived[done + HEAD.size : end])
            done = end
            yield Kind(kind), now_us, content
    finally:
        del arrived[:done]
