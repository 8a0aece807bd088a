"""footfall's own CAN format of force sensors at the feet: each sensor is a separate node.

| id | content | unit |
| --- | --- | --- |
| 0x310 + foot | force on the foot (int16), sample counter (uint16) | 0.1 N |

Big-endian, four bytes. Feet are numbered from 0 in the order of robot.yaml. Forces out of range are clamped.
As with the IMU, the sample counter distinguishes a new sample from a repeated or older one.
"""

import math
import struct

import numpy as np

from footfall.deploy.drivers.driver import CanFilter
from footfall.deploy.drivers.sample_counter import COUNTER_VALUES, SampleCounter
from footfall.deploy.frames import Frames

FIRST_ID = 0x310
FORCE_UNIT = 0.1
FRAME_BYTES = 4
MAX_AGE_US = 20_000  # largest age of a valid force: ten samples at 500 Hz

_SAMPLE = struct.Struct(">hH")
FILTERS: tuple[CanFilter, ...] = ({"can_id": FIRST_ID, "can_mask": 0x7F0, "extended": False},)


def identifiers(feet: int) -> np.ndarray:
    """Identifiers of all sensors, (feet,)."""
    return FIRST_ID + np.arange(feet)


def encode(force: np.ndarray, counter: int) -> np.ndarray:
    """Data of one sample of each sensor, (feet, 8) uint8, from forces in N; NaN is sent as 0."""
    codes = np.nan_to_num(force / FORCE_UNIT).round().clip(-32768, 32767).astype(int)
    content = b"".join(_SAMPLE.pack(code, counter % COUNTER_VALUES) + bytes(4) for code in codes.tolist())
    return np.frombuffer(content, dtype=np.uint8).reshape(-1, 8)


def decode(data: bytes) -> tuple[float, int]:
    """Force, N, and sample counter."""
    code, counter = _SAMPLE.unpack_from(data)
    return code * FORCE_UNIT, counter


class FootForceReader:
    """Latest force at each foot, from frames as they arrive."""

    def __init__(self, channel: np.ndarray) -> None:
        """`channel` (feet,): index of each sensor's bus."""
        self._channel = channel.tolist()
        self.identifiers = identifiers(len(channel))
        self._counters = [SampleCounter() for _ in self._channel]
        self._force = [math.nan] * len(self._channel)
        self._arrived_us = [-MAX_AGE_US] * len(self._channel)

    def absorb(self, frames: Frames, now_us: int) -> None:
        """Decode frames with these identifiers; those of other senders, and shorter ones, are ignored."""
        arrived = [now_us] * len(frames.id) if frames.time_us is None else frames.time_us.tolist()
        columns = (frames.id - FIRST_ID).tolist(), frames.channel.tolist(), frames.length.tolist()
        for foot, channel, length, row, arrived_us in zip(*columns, frames.data, arrived, strict=True):
            if channel != self._channel[foot] or length != FRAME_BYTES:
                continue
            force, counter = decode(row.tobytes())
            if self._counters[foot].is_new(counter):
                self._force[foot], self._arrived_us[foot] = force, arrived_us

    def force(self, now_us: int) -> np.ndarray:
        """Forces, N, (feet,); NaN for a sensor without a new sample for 20 ms."""
        pairs = zip(self._force, self._arrived_us, strict=True)
        return np.array(
            [force if now_us - arrived_us < MAX_AGE_US else math.nan for force, arrived_us in pairs]
        )
