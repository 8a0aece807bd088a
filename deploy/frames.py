"""CAN frames in batches: arrays instead of one object per frame, and what a frame costs on the wire."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

BITRATE = 1_000_000  # bit/s: one bit takes one microsecond
EXTENDED = 1 << 31  # added to an identifier of 29 bits, as SocketCAN does


class Frames(NamedTuple):
    """A batch of k data frames, in the order of their queue."""

    channel: np.ndarray  # (k,) intp, which of the robot's buses
    id: np.ndarray  # (k,) intp, identifier of 11 bits, or of 29 bits plus EXTENDED
    data: np.ndarray  # (k, 8) uint8; bytes past the length are zero
    length: np.ndarray  # (k,) intp, data length code 0..8
    time_us: np.ndarray | None = None  # (k,) arrival times of the loop's clock; None where unknown

    def take(self, rows: np.ndarray) -> "Frames":
        """The frames at some rows (indices or a mask)."""
        time_us = None if self.time_us is None else self.time_us[rows]
        return Frames(self.channel[rows], self.id[rows], self.data[rows], self.length[rows], time_us)

    def at(self, time_us: np.ndarray) -> "Frames":
        """The same frames with arrival times, us, (k,)."""
        return Frames(self.channel, self.id, self.data, self.length, time_us)


Layout = tuple[bytes, bytes, bytes]


def layout_of(frames: Frames) -> Layout:
    """Identifiers, channels and lengths of a batch as a key.

    Batches with equal keys differ in data and time alone. A comparison takes 0.2 us, looking up the sender of
    each frame 10 to 20 us: whatever depends on the layout alone is worth keeping for the next batch.
    """
    return frames.id.tobytes(), frames.channel.tobytes(), frames.length.tobytes()


def no_frames() -> Frames:
    """An empty batch."""
    nothing = np.zeros(0, np.intp)
    return Frames(nothing, nothing, np.zeros((0, 8), np.uint8), nothing)


def joined(batches: Sequence[Frames]) -> Frames:
    """Several batches (one at least) as one."""
    channel, identifier, data, length = zip(*(batch[:4] for batch in batches), strict=True)
    times = [batch.time_us for batch in batches if batch.time_us is not None]
    return Frames(
        np.concatenate(channel),
        np.concatenate(identifier),
        np.concatenate(data),
        np.concatenate(length),
        np.concatenate(times) if len(times) == len(batches) else None,
    )


def frame_bits(length: int, extended: bool = False, stuffed: bool = True) -> int:
    """Bits that a data frame occupies on the wire, the three bits of interframe space included.

    Args:
        length: data bytes, 0..8.
        extended: 29-bit identifier instead of 11-bit.
        stuffed: with the largest possible number of stuff bits; otherwise with none.

    A frame has 47 bits of overhead with an 11-bit identifier, 67 with a 29-bit one. A stuff bit can follow
    each four bits from the start of frame to the end of the checksum, after the first.
    """
    overhead, stuffable = (67, 54) if extended else (47, 34)
    stuff = (stuffable + 8 * length - 1) // 4 if stuffed else 0
    return overhead + 8 * length + stuff


_BITS = np.array([[frame_bits(length, extended) for length in range(9)] for extended in (False, True)])


def bits_of(frames: Frames) -> np.ndarray:
    """Bits of each frame on the wire with the largest possible number of stuff bits, (k,) intp."""
    return _BITS[(frames.id >= EXTENDED).astype(np.intp), frames.length]
