"""MIT-mode actuator protocol (mini-cheetah, CubeMars AK): encoding and decoding for all motors at once.

`mit_driver.py` has the identifiers.

A command is `P16 V12 KP12 KD12 T12`, a reply `id8 P16 V12 T12 [temperature8 error8]`, both big-endian with
the most significant bit first.

Scaling: makers disagree (some encode with 2^n/span and decode with (2^n - 1)/span). Here both directions use
2^n - 1, rounded to nearest: the lowest and the highest code are exactly the ends of the range, and a
round trip has an error of at most half a quantum. An even number of intervals has no code for zero, so
zero velocity or torque also has an error of half a quantum.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from footfall.common.arrays import clamped
from footfall.common.bounded_cache import BoundedCache
from footfall.common.errors import UserError


@dataclass(frozen=True)
class MotorRange:
    """Values of the highest codes in a motor's frames; ranges are symmetric except for the gains."""

    velocity: float  # rad/s
    torque: float  # N m
    position: float = 12.5  # rad
    kp: float = 500.0  # N m/rad, from 0
    kd: float = 5.0  # N m s/rad, from 0


RANGES = {
    "AK80-9": MotorRange(50.0, 18.0),
    "AK80-6": MotorRange(76.0, 12.0),
    "AK70-10": MotorRange(50.0, 25.0),
    "AK60-6": MotorRange(50.0, 15.0),
    "AK10-9": MotorRange(50.0, 65.0),
    "AK80-64": MotorRange(8.0, 144.0),
    "MIT-40-150": MotorRange(40.0, 150.0),  # generic: the ranges depend on the firmware
    "MIT-65-500": MotorRange(65.0, 500.0, kp=4000.0, kd=100.0),  # the same, for heavy machines
}

COMMUNICATION_LOST = 13  # only from simulated motors: the manual has no code for a timeout
ERRORS = {
    1: "over-temperature",
    2: "over-current",
    3: "over-voltage",
    4: "under-voltage",
    5: "encoder error",
    6: "phase imbalance",
    COMMUNICATION_LOST: "a communication timeout, and is disabled",
}

_SPECIAL = 0xFFFF_FFFF_FFFF_FFFC
CLEAR, ENTER, EXIT, ZERO = _SPECIAL - 1, _SPECIAL, _SPECIAL + 1, _SPECIAL + 2  # as 64-bit words
_HIGHEST_COMMAND = np.uint64(CLEAR - 1)

_ALL = slice(None)

_WIRE = np.dtype(">u8")  # byte order of a word in a frame

_BITS = np.array([[16], [12], [12], [12], [12]])  # position, velocity, kp, kd, torque
_COMMAND_SHIFT = np.array([[48], [36], [24], [12], [0]])
_REPLY_SHIFT = np.array([[40], [28], [16]])
_REPLY_ROWS = [0, 1, 4]  # rows of a command that are part of a reply


class Reply(NamedTuple):
    """Decoded replies of k motors."""

    values: np.ndarray  # (3, k): position rad, velocity rad/s, torque N m
    temperature_c: np.ndarray  # (k,) degrees Celsius; 0 in a short reply
    error: np.ndarray  # (k,) error code, 0 in a short reply


def words(data: np.ndarray) -> np.ndarray:
    """Frame bytes (k, 8) as 64-bit words (k,), first byte most significant."""
    if not data.flags.c_contiguous:
        data = np.ascontiguousarray(data)
    return data.view(_WIRE)[:, 0].astype(np.uint64)


def bytes_of(word: np.ndarray) -> np.ndarray:
    """64-bit words (k,) as frame bytes (k, 8)."""
    return word.astype(_WIRE).view(np.uint8).reshape(-1, 8)


def special(word: int, count: int) -> np.ndarray:
    """`count` frames of CLEAR (supported only by Damiao), ENTER, EXIT or ZERO, (count, 8) uint8."""
    return bytes_of(np.full(count, word, dtype=np.uint64))


class _Fields(NamedTuple):
    """Fields in one kind of frame: their positions in a 64-bit word and their scales, each (fields, k).
    Shifts are repeated for each motor, because broadcasting takes NumPy twice as long.
    """

    code: np.ndarray  # (fields,) uint64, word for a code of 1
    shift: np.ndarray  # uint64, bits
    mask: np.ndarray  # uint64, of a field after the shift
    lowest: np.ndarray
    highest: np.ndarray
    quantum: np.ndarray
    codes_per_unit: np.ndarray

    def pack(self, values: np.ndarray) -> np.ndarray:
        """Words (k,) from values (fields, k), which are clamped to the range."""
        codes = clamped(values, self.lowest, self.highest)
        codes -= self.lowest
        codes *= self.codes_per_unit
        np.rint(codes, out=codes)
        return self.code.dot(codes.astype(np.uint64))

    def unpack(self, word: np.ndarray) -> np.ndarray:
        """Values (fields, k) from words (k,)."""
        values = ((word >> self.shift) & self.mask).astype(float)
        values *= self.quantum
        values += self.lowest
        return values


class _PerMotor:
    """Fields of all motors, and of subsets, which are kept because selecting them takes long."""

    def __init__(self, every: _Fields) -> None:
        self._every = every
        self._subsets = BoundedCache[tuple[str, bytes], _Fields]()

    def of(self, motor: np.ndarray | slice) -> _Fields:
        """Fields of some motors (indices), or of all motors (a slice)."""
        if isinstance(motor, slice):
            return self._every
        key = motor.dtype.char, motor.tobytes()
        fields = self._subsets.get(key)
        if fields is None:
            code, *rest = self._every
            fields = self._subsets[key] = _Fields(code, *(part[:, motor] for part in rest))
        return fields


def _fields(shift: np.ndarray, bits: np.ndarray, lowest: np.ndarray, highest: np.ndarray) -> _Fields:
    """Fields at bits (fields, 1) of a word, with extreme codes for lowest and highest (fields, k)."""
    quantum = (highest - lowest) / (2.0**bits - 1)
    shifts, masks = (np.tile(part.astype(np.uint64), lowest.shape[1]) for part in (shift, 2**bits - 1))
    code = np.uint64(1) << shift[:, 0].astype(np.uint64)
    return _Fields(code, shifts, masks, lowest, highest, quantum, 1.0 / quantum)


class Codec:
    """Encodes and decodes frames of n motors at once, with their ranges."""

    def __init__(self, models: Sequence[str]) -> None:
        """Raises UserError for a motor that is not in `RANGES`."""
        for name in models:
            if name not in RANGES:
                raise UserError(f"no MIT-mode motor '{name}': there are {', '.join(RANGES)}")
        self._set([RANGES[name] for name in models])

    @classmethod
    def of(cls, ranges: Sequence[MotorRange]) -> "Codec":
        """Codec with given ranges, one for each motor."""
        codec = cls(())
        codec._set(ranges)
        return codec

    def _set(self, ranges: Sequence[MotorRange]) -> None:
        highest = (
            np.array([[r.position, r.velocity, r.kp, r.kd, r.torque] for r in ranges], dtype=float)
            .reshape(-1, 5)
            .T.copy()
        )
        lowest = -highest
        lowest[2:4] = 0.0
        command = _fields(_COMMAND_SHIFT, _BITS, lowest, highest)
        reply = _fields(_REPLY_SHIFT, _BITS[_REPLY_ROWS], lowest[_REPLY_ROWS], highest[_REPLY_ROWS])
        self._command, self._reply = _PerMotor(command), _PerMotor(reply)
        self.lowest, self.highest, self.quantum = lowest, highest, command.quantum
        self.reply_quantum = reply.quantum
        self._encoded = b"", np.zeros((0, 8), np.uint8)  # the last command, and its frames

    def encode(self, values: np.ndarray) -> np.ndarray:
        """Command frames of all motors, (n, 8) uint8, read-only. The last result is cached.

        Args:
            values: (5, n): position, velocity, kp, kd, torque, in the units of `JointCommand`. Values outside
                a motor's range are clamped.

        One command has the bits of a special frame (every value at its upper limit): its torque is sent a few
        codes lower.

        Raises:
            ValueError: a value is not finite; the caller must damp instead.
        """
        key = values.tobytes()
        if key != self._encoded[0]:
            if np.count_nonzero(np.isfinite(values)) < values.size:
                raise ValueError("a command that is not finite cannot be sent")
            self._encoded = key, bytes_of(np.minimum(self._command.of(_ALL).pack(values), _HIGHEST_COMMAND))
        return self._encoded[1]

    def decode(self, word: np.ndarray, motor: np.ndarray | slice) -> np.ndarray:
        """Commands (5, k) from words (k,), for motors (k,) (indices)."""
        return self._command.of(motor).unpack(word)

    def encode_replies(
        self, motor: np.ndarray | slice, head: np.ndarray, values: np.ndarray, tail: np.ndarray
    ) -> np.ndarray:
        """Reply frames, (k, 8) uint8.

        Args:
            motor: (k,) indices of the replying motors.
            head: (k,) uint64, their ids on the bus in the highest byte.
            values: (3, k) position, velocity, torque; clamped to the range.
            tail: (k,) uint64, temperature (degrees Celsius) * 256 + error code.
        """
        return bytes_of(self._reply.of(motor).pack(values) | head | tail)

    def decode_replies(self, data: np.ndarray, motor: np.ndarray | slice) -> Reply:
        """Replies from frames (k, 8), short ones zero-padded, of motors (k,) (indices)."""
        return Reply(self._reply.of(motor).unpack(words(data)), data[:, 6], data[:, 7])
