"""TensorBoard's event files, written without TensorBoard, whose import takes a tenth of a second.

A file is a row of records: length, checksum of the length, content, checksum of the content (TensorFlow's
TFRecord). Each content is an `Event` (tensorflow/core/util/event.proto) in the binary form of protobuf.
"""

import math
import struct
from collections.abc import Mapping

VERSION = "brain.Event:2"  # the content of a file's first event
_POLYNOMIAL = 0x82F63B78  # of CRC-32C (Castagnoli), RFC 3720, bits reversed
_MASK = 0xA282EAD8  # TensorFlow rotates and offsets checksums, since records may hold checksums
_STARTED = b"\x3a\x02\x08\x01"  # field 7, `session_log`, with field 1, `status`, equal to START


def first_record(wall_time_s: float) -> bytes:
    """The record that begins a file."""
    return _record(_double(1, wall_time_s) + _bytes(3, VERSION.encode()))


def restart_record(wall_time_s: float, step: int) -> bytes:
    """A record after which TensorBoard drops what earlier files hold of this step and later ones."""
    return _record(_double(1, wall_time_s) + _integer(2, step) + _STARTED)


def scalars_record(wall_time_s: float, step: int, scalars: Mapping[str, float]) -> bytes:
    """The record of scalars by name."""
    summary = b"".join(_bytes(1, _bytes(1, name.encode()) + _single(2, x)) for name, x in scalars.items())
    return _record(_double(1, wall_time_s) + _integer(2, step) + _bytes(5, summary))


def _record(content: bytes) -> bytes:
    length = struct.pack("<Q", len(content))
    return length + _checksum(length) + content + _checksum(content)


def _checksum(data: bytes) -> bytes:
    crc = 0xFFFFFFFF
    for byte in data:
        crc = _TABLE[(crc ^ byte) & 0xFF] ^ (crc >> 8)
    crc ^= 0xFFFFFFFF
    return struct.pack("<I", ((crc >> 15 | crc << 17) + _MASK) & 0xFFFFFFFF)


def _row(crc: int) -> int:
    for _ in range(8):
        crc = crc >> 1 ^ (_POLYNOMIAL if crc & 1 else 0)
    return crc


_TABLE = [_row(byte) for byte in range(256)]


# A field in protobuf's binary form: 8 * its number + its type (0: integer, 1: 8 bytes, 2: length and bytes,
# 5: 4 bytes), then its value. https://protobuf.dev/programming-guides/encoding/


def _integer(field: int, value: int) -> bytes:
    return bytes([8 * field]) + _varint(value)


def _double(field: int, value: float) -> bytes:
    return bytes([8 * field + 1]) + struct.pack("<d", value)


def _bytes(field: int, value: bytes) -> bytes:
    return bytes([8 * field + 2]) + _varint(len(value)) + value


def _single(field: int, value: float) -> bytes:
    try:
        packed = struct.pack("<f", value)
    except OverflowError:  # beyond what four bytes hold
        packed = struct.pack("<f", math.copysign(math.inf, value))
    return bytes([8 * field + 5]) + packed


def _varint(value: int) -> bytes:
    """A number of at least 0: seven bits a byte, the least first; the last byte's top bit is 0."""
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*found, value])
