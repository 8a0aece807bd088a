"""Records in the pipe from the control loop to the process that writes the log."""

import struct
from collections.abc import Iterator
from enum import IntEnum

START = struct.Struct("<q")  # Unix time of time zero, ns: start of the first record
FRAME = struct.Struct("<qBBI8s")  # CAN frame: time us, bus, length, identifier of `Frames`, data
FD_FRAME = struct.Struct("<qBBI64s")  # CAN FD frame, the same fields
HEAD = struct.Struct("<BIq")  # kind, length of the content, time in microseconds of the loop's clock


class Kind(IntEnum):
    """Content of a record. Numbers are float64, float32 for the network; n is the number of joints."""

    BEGIN = 0  # `START`, then JSON: joints, sizes of readings and inputs, metadata, links, URDF, file name
    READINGS = 1  # the fields of `Sensed` in their order
    COMMANDED = 2  # (5n,) sent command: position, velocity, stiffness, damping, torque
    INPUTS = 3  # policy input: see `log_numbers.flatten`
    DECISION = 4  # (5n,) decision of the policy
    OBSERVATION = 5  # observation of the network
    ACTION = 6  # action of the network
    STATE = 7  # text
    NOTE = 8  # text
    END = 9  # the run ended properly
    ODOMETRY = 10  # (85,) numbers of a nav_msgs/Odometry
    CONTACTS = 11  # (feet,) probability that each foot is in stance
    AGES = 12  # (n + 1,) age of each motor's reading and of the IMU's, s
    HEALTH = 13  # (3n,) temperatures, voltages, error codes
    FOOTHOLDS = 14  # (3 feet,) planned footholds relative to the base, heading frame, m; NaN for stance feet
    CHANGE = 15  # JSON: see `changes.Change`
    TIMING = 16  # (2,) duration of a tick and its lateness, us; only in real time
    BATTERY = 17  # (3,) voltage V, current A (negative: drawn), charge 0 to 1; NaN if unknown
    RECEIVED = 18  # CAN frames: for each, `FRAME`
    SENT = 19  # the same for sent frames
    RECEIVED_FD = 20  # CAN FD frames: for each, `FD_FRAME`
    SENT_FD = 21  # the same for sent frames
    ORDER = 22  # JSON: see `orders.Order`
    APPLIED = 23  # JSON: see `live_settings.Applied`


def record(kind: Kind, now_us: int, content: bytes = b"") -> bytes:
    """Encoded record."""
    return HEAD.pack(kind, len(content), now_us) + content


def take_records(arrived: bytearray) -> Iterator[tuple[Kind, int, bytes]]:
    """Remove each complete record from `arrived`; yields its kind, time and content."""
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
