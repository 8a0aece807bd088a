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

from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.frames import Frames

GYRO_ID, ACCELERATION_ID, QUATERNION_ID = IDS = (0x300, 0x301, 0x302)
FILTERS: tuple[CanFilter, ...] = ({"can_id": GYRO_ID, "can_mask": 0x7FC, "extended": False},)
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


class ImuReader:
    """The latest reading of an IMU, from frames as they arrive."""

    def __init__(self, channel: int) -> None:
        """`channel` is the bus that the IMU is on."""
        self._channel = channel
        self._counter = -1
        self._seen: set[int] = set()
        self._heard_us: int | None = None
        self.reading = Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))

    @property
    def heard_us(self) -> int | None:
        """When the last new reading came; None until each kind of frame has come once."""
        return self._heard_us if len(self._seen) == len(IDS) else None

    def absorb(self, frames: Frames, now_us: int) -> None:
        """Take in frames; those that are not the IMU's are left aside."""
        for identifier, channel, row in zip(
            frames.id.tolist(), frames.channel.tolist(), frames.data, strict=True
        ):
            if channel != self._channel or identifier not in IDS:
                continue
            self._seen.add(identifier)
            self._absorb_one(identifier, row.tobytes(), now_us)

    def _absorb_one(self, identifier: int, data: bytes, now_us: int) -> None:
        gyro, acceleration, quaternion = self.reading
        if identifier == GYRO_ID:
            gyro, counter = decode_gyro(data)
            if counter != self._counter:
                self._counter, self._heard_us = counter, now_us
        elif identifier == ACCELERATION_ID:
            acceleration = decode_acceleration(data)
        else:
            quaternion = decode_quaternion(data) or quaternion
        self.reading = Inertial(gyro, acceleration, quaternion)
