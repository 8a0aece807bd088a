"""MIT-mode actuator protocol (mini-cheetah, CubeMars AK): numbers to frames and back, all motors of a robot
at a time. `mit_driver.py` says which frame goes where.

A command is `P16 V12 KP12 KD12 T12`, a reply `id8 P16 V12 T12 [temperature8 error8]`, both big-endian with
the most significant bit first.

Scaling: makers disagree (some encode with 2^n/span and decode with (2^n - 1)/span). Here both directions use
2^n - 1, rounded to nearest: the lowest and the highest code mean the ends of the range exactly, and a round
trip is off by half a quantum at most. An even number of intervals has no code for zero, so zero
velocity or torque is off by half a quantum too.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError


@dataclass(frozen=True)
class MotorRange:
    """What the extreme codes of a motor's frames mean; ranges are symmetric but for the gains."""

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
    "MIT-40-150": MotorRange(40.0, 150.0),  # no maker's: the protocol leaves the ranges to the firmware
}

COMMUNICATION_LOST = 13  # of a simulated motor whose own time-out switched it off; the manual has none
ERRORS = {
    1: "over-temperature",
    2: "over-current",
    3: "over-voltage",
    4: "under-voltage",
    5: "encoder error",
    6: "phase imbalance",
    COMMUNICATION_LOST: "that it heard nothing for too long and switched itself off",
}

_SPECIAL = 0xFFFF_FFFF_FFFF_FFFC
ENTER, EXIT, ZERO = _SPECIAL, _SPECIAL + 1, _SPECIAL + 2  # as 64-bit words

_COMMAND_BITS = np.array([[16], [12], [12], [12], [12]])
_COMMAND_SHIFT = np.array([[48], [36], [24], [12], [0]], dtype=np.uint64)
_COMMAND_MASK = (2**_COMMAND_BITS - 1).astype(np.uint64)
_REPLY_SHIFT = np.array([[40], [28], [16]], dtype=np.uint64)
_REPLY_MASK = _COMMAND_MASK[[0, 1, 4]]


class Reply(NamedTuple):
    """Decoded replies of k motors."""

    values: np.ndarray  # (3, k): position rad, velocity rad/s, torque N m
    temperature_c: np.ndarray  # (k,) degrees Celsius, 0 where a short reply left it out
    error: np.ndarray  # (k,) error code, 0 where a short reply left it out


def words(data: np.ndarray) -> np.ndarray:
    """Frame bytes (k, 8) as 64-bit words (k,), first byte most significant."""
    if not data.flags.c_contiguous:
        data = np.ascontiguousarray(data)
    return data.view(">u8")[:, 0].astype(np.uint64)


def bytes_of(word: np.ndarray) -> np.ndarray:
    """64-bit words (k,) as frame bytes (k, 8)."""
    return word.astype(">u8").view(np.uint8).reshape(-1, 8)


def special(word: int, count: int) -> np.ndarray:
    """`count` frames of one of ENTER, EXIT and ZERO, (count, 8) uint8."""
    return bytes_of(np.full(count, word, dtype=np.uint64))


class Codec:
    """The ranges of n motors, ready to encode and decode all of them at once."""

    def __init__(self, models: Sequence[str]) -> None:
        """Raises UserError for a motor that is not in `RANGES`."""
        for name in models:
            if name not in RANGES:
                raise UserError(f"no MIT-mode motor '{name}': there are {', '.join(RANGES)}")
        rows = [RANGES[name] for name in models]
        self.highest = np.array(
            [[r.position, r.velocity, r.kp, r.kd, r.torque] for r in rows], dtype=float
        ).T.copy()
        self.lowest = -self.highest
        self.lowest[2:4] = 0.0
        self.quantum = (self.highest - self.lowest) / (2.0**_COMMAND_BITS - 1)
        self._codes_per_unit = 1.0 / self.quantum
        reply = [0, 1, 4]
        self._reply_highest, self._reply_lowest = self.highest[reply], self.lowest[reply]
        self.reply_quantum = self.quantum[reply]
        self._reply_codes_per_unit = 1.0 / self.reply_quantum

    def encode(self, values: np.ndarray) -> np.ndarray:
        """Command frames of all motors, (n, 8) uint8.

        Args:
            values: (5, n): position, velocity, kp, kd, torque, in the units of `JointCommand`. What lies
                outside a motor's range is clamped.

        The one command whose bits would read as a special frame (everything at its upper limit) is sent
        with a torque that is a few codes lower.

        Raises:
            ValueError: a value is not finite; the caller must damp instead.
        """
        if not math.isfinite(np.add.reduce(values, axis=None)):
            raise ValueError("a command that is not finite cannot be sent")
        codes = np.maximum(values, self.lowest)
        np.minimum(codes, self.highest, out=codes)
        codes -= self.lowest
        codes *= self._codes_per_unit
        np.rint(codes, out=codes)
        word = np.bitwise_or.reduce(codes.astype(np.uint64) << _COMMAND_SHIFT, axis=0)
        return bytes_of(np.minimum(word, np.uint64(_SPECIAL - 1)))

    def decode(self, word: np.ndarray, motor: np.ndarray | slice) -> np.ndarray:
        """Commands (5, k) from their words (k,), addressed to motors (k,) (indices)."""
        codes = (word >> _COMMAND_SHIFT) & _COMMAND_MASK
        return self.lowest[:, motor] + codes * self.quantum[:, motor]

    def encode_replies(
        self, motor: np.ndarray | slice, head: np.ndarray, values: np.ndarray, tail: np.ndarray
    ) -> np.ndarray:
        """Reply frames, (k, 8) uint8.

        Args:
            motor: (k,) indices of the motors that reply.
            head: (k,) uint64, their ids on the bus.
            values: (3, k) position, velocity, torque; clamped to the range.
            tail: (k,) uint64, temperature (degrees Celsius) * 256 + error code.
        """
        lowest = self._reply_lowest[:, motor]
        codes = np.maximum(values, lowest)
        np.minimum(codes, self._reply_highest[:, motor], out=codes)
        codes -= lowest
        codes *= self._reply_codes_per_unit[:, motor]
        np.rint(codes, out=codes)
        word = np.bitwise_or.reduce(codes.astype(np.uint64) << _REPLY_SHIFT, axis=0)
        return bytes_of(word | head << np.uint64(56) | tail)

    def decode_replies(self, data: np.ndarray, motor: np.ndarray | slice) -> Reply:
        """Replies from their frames (k, 8), short ones zero-padded, of motors (k,) (indices)."""
        codes = (words(data) >> _REPLY_SHIFT) & _REPLY_MASK
        values = self._reply_lowest[:, motor] + codes * self.reply_quantum[:, motor]
        return Reply(values, data[:, 6], data[:, 7])
