"""IMU readings as CAN frames.

| id | content | one unit |
| --- | --- | --- |
| 0x300 | gyro x y z (int16), sample counter (uint16) | 0.001 rad/s |
| 0x301 | proper acceleration x y z (int16), sample counter (uint16) | 0.005 m/s^2 |
| 0x302 | quaternion w x y z (int16), body to world | 1/32767 |

Big-endian, body axes. Readings past the range are clamped. The sample counter tells a reading that is new
from one that is repeated.
"""

import math
import struct
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

GYRO_ID, ACCELERATION_ID, QUATERNION_ID = IDS = (0x300, 0x301, 0x302)
GYRO_UNIT = 0.001
ACCELERATION_UNIT = 0.005
QUATERNION_UNIT = 1.0 / 32767.0

_SAMPLE = struct.Struct(">hhhH")
_QUATERNION = struct.Struct(">hhhh")
_UNITS = np.repeat([GYRO_UNIT, ACCELERATION_UNIT, QUATERNION_UNIT], (3, 3, 4))
_PLACES = np.array([0, 1, 2, 4, 5, 6, 8, 9, 10, 11])  # of the values among the 16-bit words
_COUNTERS = np.array([3, 7])


class Inertial(NamedTuple):
    """One reading, in body axes."""

    gyro: Sequence[float]  # (3,) rad/s
    acceleration: Sequence[float]  # (3,) m/s^2
    quaternion: Sequence[float]  # (4,) w x y z, unit length


def encode(reading: Inertial, counter: int) -> np.ndarray:
    """The three frames of a reading, (3, 8) uint8, in the order of `IDS`."""
    values = np.array([*reading.gyro, *reading.acceleration, *reading.quaternion]) / _UNITS
    words = np.empty(12, dtype=">i2")
    words[_PLACES] = np.minimum(np.maximum(np.rint(values), -32768.0), 32767.0)
    words[_COUNTERS] = (counter + 0x8000) % 0x10000 - 0x8000  # the same bits as an unsigned count
    return words.view(np.uint8).reshape(3, 8)


def decode_gyro(data: bytes) -> tuple[tuple[float, float, float], int]:
    """Angular velocity, rad/s, and the sample counter."""
    x, y, z, counter = _SAMPLE.unpack(data)
    return (x * GYRO_UNIT, y * GYRO_UNIT, z * GYRO_UNIT), counter


def decode_acceleration(data: bytes) -> tuple[float, float, float]:
    """Proper acceleration, m/s^2."""
    x, y, z, _ = _SAMPLE.unpack(data)
    return x * ACCELERATION_UNIT, y * ACCELERATION_UNIT, z * ACCELERATION_UNIT


def decode_quaternion(data: bytes) -> tuple[float, float, float, float] | None:
    """Unit quaternion w x y z, or None for a frame that carries no rotation (all zero)."""
    w, x, y, z = _QUATERNION.unpack(data)
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    return None if norm == 0.0 else (w / norm, x / norm, y / norm, z / norm)
