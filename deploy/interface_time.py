"""Time on CAN interfaces: how fast frames may be written, and how old those are that were read."""

import time

import numpy as np

from footfall.deploy.frames import frame_bits


class Pacing:
    """Lets a write wait while as many frames as an interface queues are still on their way out.

    That keeps SocketCAN from answering ENOBUFS.
    """

    def __init__(self, interfaces: int, queue_frames: int) -> None:
        """`queue_frames`: how many an interface queues for sending."""
        self._queue_s = (queue_frames - 1) * frame_bits(8) * 1e-6  # one of them is on the wire
        self._free_at = [0.0] * interfaces

    def wait(self, interface: int, bits: int) -> None:
        """Before a frame of so many bits, at 1 Mbit/s, is written."""
        now = time.monotonic()
        backlog = self._free_at[interface] - now
        if backlog > self._queue_s:
            time.sleep(backlog - self._queue_s)
        self._free_at[interface] = max(self._free_at[interface], now) + bits * 1e-6


class Arrivals:
    """Turns time stamps of the system's clock, which may be set, into times of the loop's."""

    def __init__(self) -> None:
        self._read_s = time.monotonic()

    def times_us(self, stamps_s: np.ndarray, now_us: int) -> np.ndarray:
        """When frames came that are read now, (k,), from Unix times s; to be called at each reading.

        No frame is older than the last reading, whatever a clock that was set says.
        """
        now_s = time.monotonic()
        longest_s, self._read_s = now_s - self._read_s, now_s
        return now_us - 1e6 * (time.time() - stamps_s).clip(0.0, longest_s)
