"""CAN frames in batches: arrays instead of one object per frame, and what a frame costs on the wire."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

BITRATE = 1_000_000  # bit/s: one bit takes one microsecond
FD_BITRATE = 5_000_000  # bit/s, of the data phase of CAN FD frames: moteus' rate
EXTENDED = 1 << 31  # added to an identifier of 29 bits, as SocketCAN does
FD = 1 << 30  # added to the identifier of a CAN FD frame
NUMBER = 0x1FFF_FFFF  # mask of an identifier without these
LONGEST = 64  # bytes of a CAN FD frame


class Frames(NamedTuple):
    """A batch of k data frames, in the order of their queue."""

    channel: np.ndarray  # (k,) intp, which of the robot's buses
    id: np.ndarray  # (k,) intp, identifier of 11 bits, or of 29 bits plus EXTENDED; plus FD for CAN FD
    data: np.ndarray  # (k, 8) uint8, or (k, 64) where one is of CAN FD; bytes past the length are zero
    length: np.ndarray  # (k,) intp, bytes: 0..8, or up to 64
    time_us: np.ndarray | None = None  # (k,) arrival times of the loop's clock; None where unknown

    def take(self, rows: np.ndarray) -> "Frames":
        """The frames at some rows (indices or a mask)."""
        time_us = None if self.time_us is None else self.time_us[rows]
        return Frames(self.channel[rows], self.id[rows], self.data[rows], self.length[rows], time_us)

    def of_can(self) -> "Frames":
        """Those that are not of CAN FD, with data (k, 8)."""
        if self.data.shape[1] == 8:
            return self
        found = self.take(self.id & FD == 0)
        return found._replace(data=found.data[:, :8])

    def of_fd(self) -> "Frames":
        """Those of CAN FD, with data (k, 64)."""
        found = self.take(self.id & FD != 0)
        return found if found.data.shape[1] == LONGEST else found._replace(data=_widened(found.data))

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
        _stacked(data),
        np.concatenate(length),
        np.concatenate(times) if len(times) == len(batches) else None,
    )


def _stacked(data: Sequence[np.ndarray]) -> np.ndarray:
    """Data of several batches as one array, as wide as the widest."""
    if len({each.shape[1] for each in data}) > 1:
        data = [_widened(each) for each in data]
    return np.concatenate(data)


def _widened(data: np.ndarray) -> np.ndarray:
    """Data (k, 8) or (k, 64) as (k, 64)."""
    return np.pad(data, ((0, 0), (0, LONGEST - data.shape[1])))


def frame_bits(length: int, extended: bool = False) -> int:
    """Most bits that a data frame occupies on the wire, the three bits of interframe space included.

    Args:
        length: data bytes, 0..8.
        extended: 29-bit identifier instead of 11-bit.

    A frame has 47 bits of overhead with an 11-bit identifier, 67 with a 29-bit one. A stuff bit can follow
    each four bits from the start of frame to the end of the checksum, after the first.
    """
    overhead, stuffable = (67, 54) if extended else (47, 34)
    return overhead + 8 * length + (stuffable + 8 * length - 1) // 4


def takes_fd(filters: Sequence[Mapping[str, Any]]) -> bool:
    """Whether some filters, as of a driver, let CAN FD frames through."""
    return any(each.get("fd", False) for each in filters)


def fd_bits(length: int, extended: bool = False) -> int:
    """Most bits at 1 Mbit/s in whose time a CAN FD frame passes, whose data phase runs at 5 Mbit/s.

    Before the switch of the bit rate there are 17 bits with an 11-bit identifier and 36 with a 29-bit one,
    after it 13 with the interframe space. The fast part has 5 bits of control, the data, 4 bits that count
    stuff bits, a checksum of 17 bits up to 16 bytes of data, else 21, and 6 or 7 fixed stuff bits.
    """
    slow = 36 if extended else 17
    stuffable, checksum = 5 + 8 * length, 17 + 6 if length <= 16 else 21 + 7
    fast = stuffable + stuffable // 4 + 4 + checksum
    return slow + (slow - 1) // 4 + 13 + -(-fast * BITRATE // FD_BITRATE)


_FD_BITS = np.array(
    [[fd_bits(length, extended) for length in range(LONGEST + 1)] for extended in (False, True)]
)
_BITS = np.array([[frame_bits(length, extended) for length in range(9)] for extended in (False, True)])


def bits_of(frames: Frames) -> np.ndarray:
    """Bits of each frame on the wire with the largest possible number of stuff bits, (k,) intp.

    Those of a CAN FD frame are counted at 1 Mbit/s (`fd_bits`).
    """
    extended = (frames.id >= EXTENDED).astype(np.intp)
    if frames.data.shape[1] == 8:
        return _BITS[extended, frames.length]
    plain = _BITS[extended, np.minimum(frames.length, 8)]
    return np.where(frames.id & FD != 0, _FD_BITS[extended, frames.length], plain)
