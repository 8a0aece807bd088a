"""IMUs on a serial port: their bytes are frames of up to 8 bytes, in order, with one identifier.

So the loop, the frame log and the simulated wires have only one kind of bus. A maker's protocol adds the
length of a message, its checksum and its content.
"""

import math
from typing import NamedTuple

import numpy as np

from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.drivers.imu import NORM_ERROR, Inertial
from footfall.deploy.drivers.sample_counter import SampleCounter
from footfall.deploy.frames import EXTENDED, Frames

BYTES_ID = EXTENDED | 0x1FFF_FFFF  # highest identifier with 29 bits: it has the lowest priority
SYNC = 0xFA  # first byte of a message, for both makers
LEVEL = Inertial((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))


class Sample(NamedTuple):
    """Content of one message."""

    counter: int  # 16 bits, incremented with each sample
    reading: Inertial


def to_frames(channel: int, content: bytes) -> Frames:
    """Bytes of a serial line as frames of up to 8 bytes; `channel` is the index of the line."""
    parts = [content[start : start + 8] for start in range(0, len(content), 8)]
    data = np.frombuffer(b"".join(part.ljust(8, b"\0") for part in parts), np.uint8).reshape(-1, 8)
    count = len(parts)
    lengths = np.array([len(part) for part in parts], np.intp)
    return Frames(np.full(count, channel), np.full(count, BYTES_ID), data, lengths)


def is_unit(quaternion: tuple[float, ...]) -> bool:
    """Whether a quaternion has length 1."""
    return abs(math.hypot(*quaternion) - 1.0) <= NORM_ERROR


class SerialImu:
    """Latest reading of an IMU on a serial port: an `ImuDriver`, except for the maker's three functions."""

    filters: tuple[CanFilter, ...] = (
        {"can_id": BYTES_ID & ~EXTENDED, "can_mask": 0x1FFF_FFFF, "extended": True},
    )
    identifiers: tuple[int, ...] = (BYTES_ID,)
    serial = True
    orientation = True
    oldest = "gyro"  # a message has all parts

    def __init__(self, channel: int) -> None:
        """`channel` is the index of the serial line among the robot's buses."""
        self._channel = channel
        self._waiting = bytearray()
        self._samples = SampleCounter()
        self.damaged = 0  # number of messages with a wrong checksum so far
        self.arrived_us: int | None = None  # arrival time of the latest message's last byte
        self.reading = LEVEL

    @staticmethod
    def length_of(waiting: bytes) -> int | None:
        """Length of the message that starts with `waiting`; 0 if none does, None if more bytes are needed."""
        raise NotImplementedError

    @staticmethod
    def is_intact(message: bytes) -> bool:
        """Whether the checksum is right."""
        raise NotImplementedError

    @staticmethod
    def decode(message: bytes) -> Sample | None:
        """Content of an intact message; None without a complete sample."""
        raise NotImplementedError

    @property
    def older(self) -> int:
        """Number of samples so far that were older than the latest one."""
        return self._samples.older

    def absorb(self, frames: Frames, now_us: int) -> None:
        """Decode the messages completed by these bytes."""
        arrived = [now_us] * len(frames.id) if frames.time_us is None else frames.time_us.tolist()
        columns = frames.channel.tolist(), frames.id.tolist(), frames.length.tolist()
        for channel, identifier, length, row, arrived_us in zip(*columns, frames.data, arrived, strict=True):
            if channel == self._channel and identifier == BYTES_ID:
                self._waiting += row[:length].tobytes()
                self._take_messages(arrived_us)

    def _take_messages(self, arrived_us: int) -> None:
        waiting = self._waiting
        while (start := waiting.find(SYNC)) >= 0:
            del waiting[:start]
            length = self.length_of(bytes(waiting))
            if length is None or len(waiting) < length:
                return
            message = bytes(waiting[:length])
            if not length or not self.is_intact(message):
                self.damaged += length > 0
                del waiting[:1]  # a message may start within an invalid one
                continue
            del waiting[:length]
            sample = self.decode(message)
            if sample is not None and is_unit(tuple(sample.reading.quaternion)):
                self._accept(sample, arrived_us)
        waiting.clear()

    def _accept(self, sample: Sample, arrived_us: int) -> None:
        new = self._samples.is_new(sample.counter)
        if new is None:
            return
        self.reading = sample.reading
        if new:
            self.arrived_us = arrived_us
