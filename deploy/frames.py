"""Batches of CAN frames: arrays instead of one object per frame, and the length of frames on the wire."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

BITRATE = 1_000_000  # bit/s: one bit takes one microsecond
FD_BITRATE = 5_000_000  # bit/s in the data phase of CAN FD frames: moteus' rate
EXTENDED = 1 << 31  # added to a 29-bit identifier, as in SocketCAN
FD = 1 << 30  # added to the identifier of a CAN FD frame
ID_MASK = 0x1FFF_FFFF  # mask of an identifier without these flags
MAX_FD_BYTES = 64  # largest length of a CAN FD frame, bytes


class Frames(NamedTuple):
    """A batch of k data frames, in transmission order."""

    channel: np.ndarray  # (k,) intp, index of the robot's bus
    id: np.ndarray  # (k,) intp, identifier of 11 bits, or of 29 bits plus EXTENDED; plus FD for CAN FD
    data: np.ndarray  # (k, 8) uint8, or (k, 64) if one is CAN FD; bytes beyond the length are zero
    length: np.ndarray  # (k,) intp, bytes: 0..8, or up to 64
    time_us: np.ndarray | None = None  # (k,) arrival times by the loop's clock; None if unknown

    def take(self, rows: np.ndarray) -> "Frames":
        """Frames at some rows (indices or a mask)."""
        time_us = None if self.time_us is None else self.time_us[rows]
        return Frames(self.channel[rows], self.id[rows], self.data[rows], self.length[rows], time_us)

    def can_frames(self) -> "Frames":
        """Classic CAN frames, with data (k, 8)."""
        if self.data.shape[1] == 8:
            return self
        found = self.take(self.id & FD == 0)
        return found._replace(data=found.data[:, :8])

    def fd_frames(self) -> "Frames":
        """CAN FD frames, with data (k, 64)."""
        found = self.take(self.id & FD != 0)
        return found if found.data.shape[1] == MAX_FD_BYTES else found._replace(data=_widened(found.data))

    def at(self, time_us: np.ndarray) -> "Frames":
        """The same frames with arrival times, us, (k,)."""
        return Frames(self.channel, self.id, self.data, self.length, time_us)


Layout = tuple[bytes, bytes, bytes]


def layout_of(frames: Frames) -> Layout:
    """Identifiers, channels and lengths of a batch as a key.

    Batches with equal keys differ only in data and time. A comparison takes 0.2 us, looking up the sender of
    each frame 10 to 20 us: so everything that depends only on the layout is cached for the next batch.
    """
    return frames.id.tobytes(), frames.channel.tobytes(), frames.length.tobytes()


def no_frames() -> Frames:
    """An empty batch."""
    nothing = np.zeros(0, np.intp)
    return Frames(nothing, nothing, np.zeros((0, 8), np.uint8), nothing)


def joined(batches: Sequence[Frames]) -> Frames:
    """Several batches (at least one) as one batch."""
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
    """Data of several batches as one array, with the largest width."""
    if len({each.shape[1] for each in data}) > 1:
        data = [_widened(each) for each in data]
    return np.concatenate(data)


def _widened(data: np.ndarray) -> np.ndarray:
    """Data (k, 8) or (k, 64) as (k, 64)."""
    return np.pad(data, ((0, 0), (0, MAX_FD_BYTES - data.shape[1])))


def frame_bits(length: int, extended: bool = False) -> int:
    """Largest number of bits of a data frame on the wire, including the three bits of interframe space.

    Args:
        length: data bytes, 0..8.
        extended: 29-bit identifier instead of 11-bit.

    A frame has 47 bits of overhead with an 11-bit identifier, 67 with a 29-bit one. From the start of frame
    to the end of the checksum, a stuff bit can follow each four bits, after the first.
    """
    overhead, stuffable = (67, 54) if extended else (47, 34)
    return overhead + 8 * length + (stuffable + 8 * length - 1) // 4


def takes_fd(filters: Sequence[Mapping[str, Any]]) -> bool:
    """Whether any of a driver's filters accepts CAN FD frames."""
    return any(each.get("fd", False) for each in filters)


def fd_bits(length: int, extended: bool = False) -> int:
    """Duration of a CAN FD frame with a data phase at 5 Mbit/s, as the largest number of bits at 1 Mbit/s.

    Before the switch of the bit rate there are 17 bits with an 11-bit identifier and 36 with a 29-bit one,
    after it 13 including the interframe space. The fast part has 5 bits of control, the data, 4 bits for the
    number of stuff bits, a checksum of 17 bits up to 16 bytes of data, else 21, and 6 or 7 fixed stuff bits.
    """
    slow = 36 if extended else 17
    stuffable, checksum = 5 + 8 * length, 17 + 6 if length <= 16 else 21 + 7
    fast = stuffable + stuffable // 4 + 4 + checksum
    return slow + (slow - 1) // 4 + 13 + -(-fast * BITRATE // FD_BITRATE)


_FD_BITS = np.array(
    [[fd_bits(length, extended) for length in range(MAX_FD_BYTES + 1)] for extended in (False, True)]
)
_BITS = np.array([[frame_bits(length, extended) for length in range(9)] for extended in (False, True)])


def bits_of(frames: Frames) -> np.ndarray:
    """Bits of each frame on the wire, with the largest possible number of stuff bits, (k,) intp.

    Those of a CAN FD frame are counted at 1 Mbit/s (`fd_bits`).
    """
    extended = (frames.id >= EXTENDED).astype(np.intp)
    if frames.data.shape[1] == 8:
        return _BITS[extended, frames.length]
    classic = _BITS[extended, np.minimum(frames.length, 8)]
    return np.where(frames.id & FD != 0, _FD_BITS[extended, frames.length], classic)
