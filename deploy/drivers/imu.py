"""footfall's own CAN format of IMU readings.

| id | content | unit |
| --- | --- | --- |
| 0x300 | gyro x y z (int16), sample counter (uint16) | 0.001 rad/s |
| 0x301 | proper acceleration x y z (int16), sample counter (uint16) | 0.005 m/s^2 |
| 0x302 | quaternion w x y z (int16), body to world | 1/32767 |

Big-endian, body axes. Readings out of range are clamped. The sample counter distinguishes a new reading from
a repeated one, and from one older than the latest, which was replayed or overtaken and is ignored. A shorter
frame, and a quaternion whose length is not 1, count as not received.

An IMU without orientation sends only the first two frames (`footfall-inertial`).
"""

import math
import struct
from collections.abc import Sequence
from operator import truediv
from typing import NamedTuple

import numpy as np

from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.drivers.sample_counter import COUNTER_VALUES, SampleCounter
from footfall.deploy.frames import Frames, layout_of

GYRO_ID, ACCELERATION_ID, QUATERNION_ID = IDS = (0x300, 0x301, 0x302)
GYRO_UNIT = 0.001
ACCELERATION_UNIT = 0.005
QUATERNION_UNIT = 1.0 / 32767.0
NORM_ERROR = 0.01  # largest error of a quaternion's length; rounding causes 0.00003

_SAMPLE = struct.Struct(">hhhH")
_QUATERNION = struct.Struct(">hhhh")
_UNITS = (GYRO_UNIT,) * 3 + (ACCELERATION_UNIT,) * 3 + (QUATERNION_UNIT,) * 4
_ALL = struct.Struct(">hhhHhhhHhhhh")  # the three frames of a reading, concatenated


class Inertial(NamedTuple):
    """One reading, in body axes."""

    gyro: Sequence[float]  # (3,) rad/s
    acceleration: Sequence[float]  # (3,) m/s^2
    quaternion: Sequence[float]  # (4,) w x y z, unit length


def encode(reading: Inertial, counter: int) -> np.ndarray:
    """The three frames of a reading, (3, 8) uint8, in the order of `IDS`."""
    values = (*reading.gyro, *reading.acceleration, *reading.quaternion)
    codes = list(map(truediv, values, _UNITS))
    count = counter % COUNTER_VALUES
    try:
        data = _packed(codes, count)
    except (struct.error, OverflowError, ValueError):  # out of range, infinite, or NaN
        data = _packed([max(-32768.0, min(32767.0, code)) for code in codes], count)
    return np.ndarray((3, 8), np.uint8, data)


def _packed(codes: list[float], count: int) -> bytes:
    """The three frames, concatenated. A clamped NaN becomes the highest value."""
    gx, gy, gz, ax, ay, az, *quaternion = map(round, codes)
    return _ALL.pack(gx, gy, gz, count, ax, ay, az, count, *quaternion)


def decode_gyro(data: bytes) -> tuple[tuple[float, float, float], int]:
    """Angular velocity, rad/s, and sample counter."""
    x, y, z, counter = _SAMPLE.unpack(data)
    return (x * GYRO_UNIT, y * GYRO_UNIT, z * GYRO_UNIT), counter


def decode_acceleration(data: bytes) -> tuple[float, float, float]:
    """Proper acceleration, m/s^2."""
    x, y, z, _ = _SAMPLE.unpack(data)
    return x * ACCELERATION_UNIT, y * ACCELERATION_UNIT, z * ACCELERATION_UNIT


def decode_quaternion(data: bytes) -> tuple[float, float, float, float] | None:
    """Unit quaternion w x y z, or None for a frame whose quaternion does not have length 1."""
    return _unit_quaternion(*_QUATERNION.unpack(data))


def _unit_quaternion(w: int, x: int, y: int, z: int) -> tuple[float, float, float, float] | None:
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if abs(norm * QUATERNION_UNIT - 1.0) > NORM_ERROR:
        return None
    return w / norm, x / norm, y / norm, z / norm


class ImuReader:
    """Latest reading of an IMU, from frames as they arrive: an `ImuDriver`."""

    filters: tuple[CanFilter, ...] = ({"can_id": GYRO_ID, "can_mask": 0x7FC, "extended": False},)
    identifiers: tuple[int, ...] = IDS
    imu_end = "footfall.plant.imu_ends:FootfallImuEnd"
    orientation = True

    def __init__(self, channel: int) -> None:
        """`channel` is the index of the IMU's bus."""
        self._channel = channel
        ones = np.ones(len(IDS), np.intp)
        self._reading_layout = layout_of(
            Frames(channel * ones, np.array(IDS), np.zeros((3, 8), np.uint8), 8 * ones)
        )
        self._gyro_samples, self._acceleration_samples = SampleCounter(), SampleCounter()
        self._arrived_us: list[int | None] = [None, None, None]  # of each part, in the order of `IDS`
        self.reading = Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))

    @property
    def arrived_us(self) -> int | None:
        """Arrival time of the oldest of the three latest parts, us; None until each has arrived."""
        gyro, acceleration, quaternion = self._arrived_us
        if gyro is None or acceleration is None or quaternion is None:
            return None
        return min(gyro, acceleration, quaternion)

    @property
    def older(self) -> int:
        """Number of samples so far that were older than the latest one."""
        return max(self._gyro_samples.older, self._acceleration_samples.older)

    @property
    def oldest(self) -> str:
        """Name of the oldest part."""
        times = [-math.inf if arrived_us is None else arrived_us for arrived_us in self._arrived_us]
        return Inertial._fields[times.index(min(times))]

    def absorb(self, frames: Frames, now_us: int) -> None:
        """Decode frames; those of other senders, and shorter ones, are ignored.

        The time of a part is its frame's arrival time if the bus has it: a frame that waited in a queue is
        old.
        """
        arrived = [now_us] * len(frames.id) if frames.time_us is None else frames.time_us.tolist()
        if layout_of(frames) == self._reading_layout:
            self._absorb_reading(frames.data.tobytes(), arrived)
            return
        columns = frames.id.tolist(), frames.channel.tolist(), frames.length.tolist()
        rows = zip(*columns, frames.data, arrived, strict=True)
        for identifier, channel, length, row, arrived_us in rows:
            if channel == self._channel and identifier in IDS and length == 8:
                self._absorb_frame(identifier, row.tobytes(), arrived_us)

    def _absorb_reading(self, data: bytes, arrived: list[int]) -> None:
        """Decode the three frames of a reading at once, with their arrival times, us."""
        gx, gy, gz, gyro_count, ax, ay, az, acceleration_count, *words = _ALL.unpack(data)
        gyro_new = self._gyro_samples.is_new(gyro_count)
        acceleration_new = self._acceleration_samples.is_new(acceleration_count)
        if gyro_new is None or acceleration_new is None:
            return
        if gyro_new:
            self._arrived_us[0] = arrived[0]
        if acceleration_new:
            self._arrived_us[1] = arrived[1]
        quaternion: Sequence[float] | None = _unit_quaternion(*words)
        if quaternion is None:
            quaternion = self.reading.quaternion
        else:
            self._arrived_us[2] = arrived[2]
        self.reading = Inertial(
            (gx * GYRO_UNIT, gy * GYRO_UNIT, gz * GYRO_UNIT),
            (ax * ACCELERATION_UNIT, ay * ACCELERATION_UNIT, az * ACCELERATION_UNIT),
            quaternion,
        )

    def _absorb_frame(self, identifier: int, data: bytes, arrived_us: int) -> None:
        gyro, acceleration, quaternion = self.reading
        if identifier == GYRO_ID:
            rates, counter = decode_gyro(data)
            new = self._gyro_samples.is_new(counter)
            gyro = gyro if new is None else rates
            if new:
                self._arrived_us[0] = arrived_us
        elif identifier == ACCELERATION_ID:
            new = self._acceleration_samples.is_new(_SAMPLE.unpack(data)[3])
            acceleration = acceleration if new is None else decode_acceleration(data)
            if new:
                self._arrived_us[1] = arrived_us
        elif (decoded := decode_quaternion(data)) is not None:
            quaternion = decoded
            self._arrived_us[2] = arrived_us
        self.reading = Inertial(gyro, acceleration, quaternion)


class InertialReader(ImuReader):
    """An IMU that sends only gyro and acceleration; a quaternion is ignored."""

    imu_end = "footfall.plant.imu_ends:InertialImuEnd"
    orientation = False

    @property
    def arrived_us(self) -> int | None:
        gyro, acceleration, _ = self._arrived_us
        return None if gyro is None or acceleration is None else min(gyro, acceleration)

    @property
    def oldest(self) -> str:
        gyro, acceleration, _ = (
            -math.inf if arrived_us is None else arrived_us for arrived_us in self._arrived_us
        )
        return "gyro" if gyro <= acceleration else "acceleration"
