"""Reads a run's feed. Uses only the standard library: other Pythons can run it, such as a robot's ROS."""

import os
import socket
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")  # opcode, size of the rest
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_SCHEMA, _CHANNEL, _MESSAGE_CODE, _METADATA, _FOOTER = 0x03, 0x04, 0x05, 0x0C, 0x02
_MAX_SIZE = 2**26  # bytes of a record


class FeedChannel(NamedTuple):
    """Topic of a feed."""

    topic: str
    kind: str  # message type, such as sensor_msgs/msg/Imu
    definition: str  # of that type, as `ros2msg`
    latched: bool


class FeedMessage(NamedTuple):
    """Message of a feed."""

    channel: FeedChannel
    sequence: int  # counts the messages of a channel; a gap means that some were dropped
    time_ns: int
    data: bytes  # CDR


class FeedReader:
    """Iterates over the messages of a feed until it ends.

    Attributes:
        metadata: metadata of the run, as in its log: JSON by name. Complete after the first message.
        ended: whether the run ended properly; False if its process died.
    """

    def __init__(self, path: str | os.PathLike[str], timeout_s: float | None = None) -> None:
        """Connect.

        Args:
            path: the feed's socket.
            timeout_s: maximum silence; then iteration raises TimeoutError. None waits forever.

        Raises:
            OSError: the feed does not exist.
        """
        self.metadata: dict[str, str] = {}
        self.ended = False
        self._channels: dict[int, FeedChannel] = {}
        self._schemas: dict[int, tuple[str, str]] = {}
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(timeout_s)
        try:
            self._socket.connect(os.fspath(Path(path)))
            self._file: BinaryIO = self._socket.makefile("rb")
        except OSError:
            self._socket.close()
            raise

    def close(self) -> None:
        """Disconnect."""
        self._file.close()
        self._socket.close()

    def __iter__(self) -> Iterator[FeedMessage]:
        if self._file.read(len(_MAGIC)) != _MAGIC:
            return
        while len(head := self._file.read(_HEAD.size)) == _HEAD.size:
            opcode, size = _HEAD.unpack(head)
            if size > _MAX_SIZE or len(content := self._file.read(size)) < size:
                return
            if opcode == _MESSAGE_CODE:
                number, sequence, time_ns, _ = _MESSAGE.unpack_from(content)
                yield FeedMessage(self._channels[number], sequence, time_ns, content[_MESSAGE.size :])
            elif opcode == _FOOTER:
                self.ended = True
                return
            else:
                self._define(opcode, content)

    def _define(self, opcode: int, content: bytes) -> None:
        fields = _Fields(content)
        if opcode == _SCHEMA:
            number, kind, _ = fields.number("<H"), fields.text(), fields.text()
            self._schemas[number] = kind, fields.text()
        elif opcode == _CHANNEL:
            number, schema, topic, _ = fields.number("<H"), fields.number("<H"), fields.text(), fields.text()
            latched = "transient_local" in fields.map().get("offered_qos_profiles", "")
            self._channels[number] = FeedChannel(topic, *self._schemas[schema], latched)
        elif opcode == _METADATA and fields.text() == "footfall":
            self.metadata.update(fields.map())


class _Fields:
    """Reads the fields of a record one after the other."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, 0

    def number(self, layout: str) -> int:
        (value,) = struct.unpack_from(layout, self._content, self._at)
        self._at += struct.calcsize(layout)
        return int(value)

    def text(self) -> str:
        size = self.number("<I")
        self._at += size
        return self._content[self._at - size : self._at].decode()

    def map(self) -> dict[str, str]:
        end = self.number("<I") + self._at
        entries = {}
        while self._at < end:
            name = self.text()  # in a separate line: in an assignment Python evaluates the right side first
            entries[name] = self.text()
        return entries
