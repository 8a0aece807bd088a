"""Time on CAN interfaces: pacing of writes, and arrival times of frames."""

import time

import numpy as np

from footfall.deploy.frames import frame_bits


class Pacing:
    """Delays a write while an interface's transmit queue is full.

    Otherwise SocketCAN would return ENOBUFS.
    """

    def __init__(self, interfaces: int, queue_frames: int) -> None:
        """`queue_frames` is the length of an interface's transmit queue."""
        self._queue_s = (queue_frames - 1) * frame_bits(8) * 1e-6  # one of them is on the wire
        self._free_at = [0.0] * interfaces

    def wait(self, interface: int, bits: int) -> None:
        """Wait until a frame of this many bits, at 1 Mbit/s, may be written."""
        now = time.monotonic()
        backlog = self._free_at[interface] - now
        if backlog > self._queue_s:
            time.sleep(backlog - self._queue_s)
        self._free_at[interface] = max(self._free_at[interface], now) + bits * 1e-6


class Arrivals:
    """Converts time stamps of the system's clock, which may be set, to the loop's clock."""

    def __init__(self) -> None:
        self._read_s = time.monotonic()

    def times_us(self, stamps_s: np.ndarray, now_us: int) -> np.ndarray:
        """Arrival times, us, (k,), of frames read now, from Unix times s. Call it at each read.

        No frame is older than the last read, even if the system's clock was set in between.
        """
        now_s = time.monotonic()
        max_age_s, self._read_s = now_s - self._read_s, now_s
        return now_us - 1e6 * (time.time() - stamps_s).clip(0.0, max_age_s)
