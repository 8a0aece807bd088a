"""Xsens MTi 600 on CAN, according to Movella's "MT CAN Protocol Documentation" (MT1604P).

| id | content | unit |
| --- | --- | --- |
| 0x006 | group counter, uint16: first frame of a sample | |
| 0x021 | quaternion w x y z, 4 int16, sensor to world (ENU) | 1/32767 |
| 0x032 | angular velocity x y z, 3 int16 | 2^-9 rad/s |
| 0x034 | proper acceleration x y z, 3 int16 | 2^-8 m/s^2 |

Big-endian. Each part is used once per group: a repeated part belongs to a sample with a lost counter, and is
ignored. Axes are those of the sensor's housing, z up: align them with the base's.
"""

import math
import struct

import numpy as np

from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.drivers.imu import Inertial, decode_quaternion
from footfall.deploy.drivers.sample_counter import COUNTER_VALUES, SampleCounter
from footfall.deploy.drivers.serial_imu import LEVEL
from footfall.deploy.frames import Frames

COUNTER_ID, QUATERNION_ID, GYRO_ID, ACCELERATION_ID = IDS = (0x006, 0x021, 0x032, 0x034)
GYRO_UNIT, ACCELERATION_UNIT, QUATERNION_UNIT = 2.0**-9, 2.0**-8, 1.0 / 32767.0
LENGTHS = {COUNTER_ID: 2, QUATERNION_ID: 8, GYRO_ID: 6, ACCELERATION_ID: 6}
PARTS = {GYRO_ID: "gyro", ACCELERATION_ID: "acceleration", QUATERNION_ID: "quaternion"}
UNITS = {GYRO_ID: GYRO_UNIT, ACCELERATION_ID: ACCELERATION_UNIT, QUATERNION_ID: QUATERNION_UNIT}
_COUNT = struct.Struct(">H")


class XsensCanImu:
    """Latest reading of an Xsens MTi on CAN, with orientation: an `ImuDriver`."""

    filters: tuple[CanFilter, ...] = tuple(
        {"can_id": identifier, "can_mask": 0x7FF, "extended": False} for identifier in IDS
    )
    identifiers: tuple[int, ...] = IDS
    imu_end = "footfall.plant.imu_ends:XsensCanEnd"
    orientation = True

    def __init__(self, channel: int) -> None:
        """`channel` is the index of the IMU's bus."""
        self._channel = channel
        self._groups = SampleCounter()
        self._missing: set[int] = set()  # identifiers missing from the current group
        self._group_is_new = False  # whether the group is new, instead of repeated
        self._arrived_us: dict[int, int | None] = dict.fromkeys(PARTS)
        self.reading = LEVEL

    @property
    def arrived_us(self) -> int | None:
        times = [each for each in self._arrived_us.values() if each is not None]
        return min(times) if len(times) == len(PARTS) else None

    @property
    def oldest(self) -> str:
        times = {
            part: -math.inf if arrived_us is None else arrived_us
            for part, arrived_us in self._arrived_us.items()
        }
        return PARTS[min(times, key=times.__getitem__)]

    @property
    def older(self) -> int:
        """Number of samples so far that were older than the latest one."""
        return self._groups.older

    def absorb(self, frames: Frames, now_us: int) -> None:
        """Decode frames; those of other senders, and of another length, are ignored."""
        arrived = [now_us] * len(frames.id) if frames.time_us is None else frames.time_us.tolist()
        columns = frames.channel.tolist(), frames.id.tolist(), frames.length.tolist()
        for channel, identifier, length, row, arrived_us in zip(*columns, frames.data, arrived, strict=True):
            if channel == self._channel and LENGTHS.get(identifier) == length:
                self._absorb_frame(identifier, row[:length].tobytes(), arrived_us)

    def _absorb_frame(self, identifier: int, data: bytes, arrived_us: int) -> None:
        if identifier == COUNTER_ID:
            new = self._groups.is_new(*_COUNT.unpack(data))
            self._missing, self._group_is_new = set() if new is None else set(PARTS), bool(new)
            return
        values = _decoded(identifier, data)
        if identifier not in self._missing or values is None:
            return
        self._missing.remove(identifier)
        self.reading = self.reading._replace(**{PARTS[identifier]: values})
        if self._group_is_new:
            self._arrived_us[identifier] = arrived_us


def _decoded(identifier: int, data: bytes) -> tuple[float, ...] | None:
    """A part of the reading; None for a quaternion whose length is not 1."""
    if identifier == QUATERNION_ID:
        return decode_quaternion(data)
    return tuple(code * UNITS[identifier] for code in struct.unpack(">hhh", data))


def encode(reading: Inertial, counter: int) -> np.ndarray:
    """Frames of a sample, (4, 8) uint8, in the order of `IDS`; values out of range are clamped."""
    parts = [_COUNT.pack(counter % COUNTER_VALUES)]
    for identifier in IDS[1:]:
        codes = np.nan_to_num(np.array(getattr(reading, PARTS[identifier])) / UNITS[identifier])
        parts.append(codes.round().clip(-32768, 32767).astype(">i2").tobytes())
    return np.frombuffer(b"".join(part.ljust(8, b"\0") for part in parts), np.uint8).reshape(-1, 8)
