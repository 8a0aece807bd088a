"""VectorNav VN-100 on a serial port: a binary output message, according to the manual UM001.

A message is 0xFA, groups (one byte), fields of each group (two bytes), content, checksum. The content is
little-endian, the checksum (CRC-16-CCITT over all bytes except the first) big-endian. This driver reads one
message, group 1 with the fields 0x0131:

| field | content |
| --- | --- |
| 0 | time since start, uint64, ns |
| 4 | quaternion x y z w, x forward and z down, to a world frame with z down |
| 5 | angular velocity, 3 float32, rad/s |
| 8 | acceleration, 3 float32, m/s^2, including gravity |

The time in whole milliseconds is the sample counter: the sensor sends at most 800 messages per second.
Readings and world are rotated by half a turn about x, to y left and z up.
"""

import binascii
import struct

from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.drivers.sample_counter import COUNTER_VALUES
from footfall.deploy.drivers.serial_imu import SYNC, Sample, SerialImu

HEADER = bytes((SYNC, 0x01, 0x31, 0x01))
TICK_NS = 1_000_000
_CONTENT = struct.Struct("<Q4f3f3f")
MESSAGE_BYTES = len(HEADER) + _CONTENT.size + 2


class VectorNavImu(SerialImu):
    """A VectorNav VN-100, with orientation."""

    imu_end = "footfall.plant.imu_ends:VectorNavEnd"

    @staticmethod
    def length_of(waiting: bytes) -> int | None:
        return MESSAGE_BYTES if HEADER.startswith(waiting[: len(HEADER)]) else 0

    @staticmethod
    def is_intact(message: bytes) -> bool:
        return checksum(message[1:]) == 0

    @staticmethod
    def decode(message: bytes) -> Sample | None:
        time_ns, x, y, z, w, *vectors = _CONTENT.unpack_from(message, len(HEADER))
        gyro, acceleration = vectors[:3], vectors[3:]
        reading = Inertial(_turned(gyro), _turned(acceleration), (w, x, -y, -z))
        return Sample(time_ns // TICK_NS % COUNTER_VALUES, reading)


def checksum(content: bytes) -> int:
    """CRC-16-CCITT, starting at 0; 0 for content with checksum."""
    return binascii.crc_hqx(content, 0)


def _turned(vector: list[float] | tuple[float, ...]) -> tuple[float, float, float]:
    """Vector after half a turn about x."""
    x, y, z = vector
    return x, -y, -z


def encode(sample: Sample) -> bytes:
    """Message of a sample; its time is `sample.counter` milliseconds."""
    w, x, y, z = sample.reading.quaternion
    gyro, acceleration = _turned(tuple(sample.reading.gyro)), _turned(tuple(sample.reading.acceleration))
    content = _CONTENT.pack(sample.counter * TICK_NS, x, -y, -z, w, *gyro, *acceleration)
    return HEADER + content + checksum(HEADER[1:] + content).to_bytes(2, "big")
