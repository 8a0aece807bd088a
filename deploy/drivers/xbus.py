"""Xsens MTi on a serial port: the message MTData2 of Movella's "MT Low Level Communication Protocol".

A message is 0xFA, bus id 0xFF, message id 0x36, length, data, checksum. After a length of 0xFF, two bytes
have the actual length. The sum of all bytes except the first is 0 modulo 256. Data are packets: identifier
(two bytes), length, content; all big-endian. Required packets, with 32-bit floats in SI units:

| packet | content |
| --- | --- |
| 0x1020 | packet counter, uint16 |
| 0x2010, 0x2018 | quaternion w x y z, sensor to world; ENU and NWU, with z up |
| 0x4020 | proper acceleration |
| 0x8020 | angular velocity |

Other packets are ignored. Axes are those of the sensor's housing, z up: align them with the base's.
"""

import struct

from footfall.deploy.drivers.imu import Inertial
from footfall.deploy.drivers.sample_counter import COUNTER_VALUES
from footfall.deploy.drivers.serial_imu import SYNC, Sample, SerialImu

HEADER = bytes((SYNC, 0xFF, 0x36))
LONG = 0xFF  # in place of a length: two more bytes have it
COUNTER, ACCELERATION, GYRO = 0x1020, 0x4020, 0x8020
QUATERNIONS = (0x2010, 0x2018)
_COUNT, _THREE, _FOUR = struct.Struct(">H"), struct.Struct(">fff"), struct.Struct(">ffff")
_PACKET = struct.Struct(">HB")


class XbusImu(SerialImu):
    """An Xsens MTi, with orientation."""

    imu_end = "footfall.plant.imu_ends:XbusEnd"

    @staticmethod
    def length_of(waiting: bytes) -> int | None:
        if not HEADER.startswith(waiting[:3]):
            return 0
        if len(waiting) < 6:
            return None
        return 5 + waiting[3] if waiting[3] != LONG else 7 + int.from_bytes(waiting[4:6], "big")

    @staticmethod
    def is_intact(message: bytes) -> bool:
        return sum(message[1:]) % 256 == 0

    @staticmethod
    def decode(message: bytes) -> Sample | None:
        packets = dict(_packets(message))
        quaternion = next((packets[each] for each in QUATERNIONS if each in packets), b"")
        try:
            (counter,) = _COUNT.unpack(packets.get(COUNTER, b""))
            gyro = _THREE.unpack(packets.get(GYRO, b""))
            acceleration = _THREE.unpack(packets.get(ACCELERATION, b""))
            return Sample(counter, Inertial(gyro, acceleration, _FOUR.unpack(quaternion)))
        except struct.error:  # a packet is missing, or has another format
            return None


def _packets(message: bytes) -> list[tuple[int, bytes]]:
    """Identifiers and contents of a message's packets; a truncated packet is ignored."""
    found, at, end = [], 4 if message[3] != LONG else 6, len(message) - 1
    while at + _PACKET.size <= end:
        identifier, length = _PACKET.unpack_from(message, at)
        at += _PACKET.size + length
        if at <= end:
            found.append((identifier, message[at - length : at]))
    return found


def encode(sample: Sample) -> bytes:
    """A message with the required packets."""
    gyro, acceleration, quaternion = sample.reading
    contents = (
        (COUNTER, _COUNT.pack(sample.counter % COUNTER_VALUES)),
        (QUATERNIONS[0], _FOUR.pack(*quaternion)),
        (ACCELERATION, _THREE.pack(*acceleration)),
        (GYRO, _THREE.pack(*gyro)),
    )
    data = b"".join(_PACKET.pack(identifier, len(content)) + content for identifier, content in contents)
    message = HEADER + bytes((len(data),)) + data
    return message + bytes((-sum(message[1:]) % 256,))
