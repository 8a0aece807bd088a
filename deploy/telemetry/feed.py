"""The feed: a run's messages over a Unix socket, for any number of subscribers.

A subscriber connects and reads. The content is an MCAP stream without chunks (https://mcap.dev/spec): any
reader of MCAP streams can read it, and the data saved from the socket is an MCAP file:

    magic, Header, Metadata "footfall" (as in a log), then Schema, Channel and Message records by time,
    DataEnd, Footer and magic only after an orderly end of the run

- A topic's Schema and Channel come before its first message. Messages are in CDR (`ros2msg`); topics, types
  and quality of service are those of `topics.py`. A record is one byte of opcode, eight bytes of length
  (little-endian) and its content; `feed_reader.py` reads it using only the standard library.
- A new subscriber first gets the last message of each latched topic.
- `sequence` counts the messages of a channel. A gap means that the subscriber was too slow: messages that do
  not fit into its buffer are dropped. If a latched one does not fit, the subscriber is disconnected.
- The feed is read-only: a subscriber that sends anything is disconnected.
"""

import os
import select
import socket
import stat
import struct
import time
from contextlib import suppress
from pathlib import Path

from mcap.data_stream import RecordBuilder
from mcap.records import Channel, DataEnd, Footer, Header, McapRecord, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from footfall.common.errors import UserError
from footfall.deploy.telemetry.definitions import definition
from footfall.deploy.telemetry.mcap_file import METADATA
from footfall.deploy.telemetry.topics import TOPICS

MAX_SUBSCRIBERS = 16
MAX_WAITING_BYTES = 2 * 2**20  # per subscriber: a few seconds
MESSAGE = struct.Struct("<BQHIQQ")  # opcode, size of the rest, channel, sequence, log time, publish time
_MESSAGE_OPCODE, _REST = 0x05, MESSAGE.size - 9


def listen(path: Path) -> socket.socket:
    """Create the socket of a feed; only this user can connect. The file of a dead feed is replaced.

    Raises:
        UserError: the socket cannot be created, or another run serves it.
    """
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        _remove_dead(path)
        old_mask = os.umask(0o077)
        try:
            listener.bind(os.fspath(path))
        finally:
            os.umask(old_mask)
        listener.listen(MAX_SUBSCRIBERS)
    except OSError as error:
        listener.close()
        raise UserError(f"cannot serve a feed at {path}: {error.strerror or error}") from None
    return listener


def _remove_dead(path: Path) -> None:
    """Remove the socket of a process that has ended."""
    with suppress(FileNotFoundError):
        if not stat.S_ISSOCK(path.stat().st_mode):
            return
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            probe.settimeout(1.0)
            with suppress(ConnectionRefusedError):
                probe.connect(os.fspath(path))
                return
        path.unlink()


class Feed:
    """Sends messages to subscribers without waiting for them."""

    def __init__(self, listener: socket.socket, metadata: dict[str, str]) -> None:
        self._listener = listener
        listener.setblocking(False)
        self._preamble = MCAP0_MAGIC + _bytes(Header("ros2", "footfall"), Metadata(METADATA, metadata))
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._sent: list[int] = []  # number of messages of each channel
        self._latest: dict[str, bytes] = {}  # last message of each latched topic
        self._waiting: dict[socket.socket, bytearray] = {}  # by subscriber

    @property
    def readable(self) -> list[socket.socket]:
        """Sockets on which `serve` waits to read."""
        return [self._listener, *self._waiting]

    @property
    def writable(self) -> list[socket.socket]:
        """Sockets on which `serve` waits to write."""
        return [each for each, waiting in self._waiting.items() if waiting]

    def put(self, topic: str, time_ns: int, message: bytes) -> None:
        """Send a message to all subscribers."""
        latched = TOPICS[topic].latched
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._register(topic)
        sequence = self._sent[channel]
        self._sent[channel] = (sequence + 1) & 0xFFFFFFFF
        if not self._waiting and not latched:
            return
        size = _REST + len(message)
        record = MESSAGE.pack(_MESSAGE_OPCODE, size, channel, sequence, time_ns, time_ns) + message
        if latched:
            self._latest[topic] = record
        for subscriber, waiting in list(self._waiting.items()):
            if len(waiting) + len(record) <= MAX_WAITING_BYTES:
                waiting.extend(record)
            elif latched:
                self._drop(subscriber)

    def serve(self) -> None:
        """Accept new subscribers, and send as much waiting data as possible without blocking."""
        self._accept()
        for subscriber, waiting in list(self._waiting.items()):
            try:
                with suppress(BlockingIOError):
                    if waiting:
                        del waiting[: subscriber.send(waiting)]
                with suppress(BlockingIOError):
                    subscriber.recv(1)  # end of file, or forbidden data
                    self._drop(subscriber)
            except OSError:
                self._drop(subscriber)

    def end(self, complete: bool, timeout_s: float) -> None:
        """End the feed: subscribers get the remaining data if they read it within `timeout_s`."""
        if complete:
            for waiting in self._waiting.values():
                waiting.extend(_bytes(DataEnd(0), Footer(0, 0, 0)) + MCAP0_MAGIC)
        until = time.monotonic() + timeout_s
        while self.writable and (remaining_s := until - time.monotonic()) > 0.0:
            select.select([], self.writable, [], remaining_s)
            self.serve()
        for subscriber in list(self._waiting):
            self._drop(subscriber)
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            subscriber, _ = self._listener.accept()
            if len(self._waiting) == MAX_SUBSCRIBERS:
                subscriber.close()
                return
            subscriber.setblocking(False)
            self._waiting[subscriber] = bytearray(self._preamble + b"".join(self._latest.values()))

    def _register(self, topic: str) -> int:
        """Define a topic for current and later subscribers."""
        topic_type, records = TOPICS[topic], list[McapRecord]()
        if topic_type.kind not in self._schemas:
            number = self._schemas[topic_type.kind] = len(self._schemas) + 1
            schema = Schema(number, definition(topic_type.kind).encode(), "ros2msg", topic_type.kind)
            records.append(schema)
        channel = self._channels[topic] = len(self._sent)
        self._sent.append(0)
        qos = {"offered_qos_profiles": topic_type.qos_profile}
        records.append(Channel(channel, topic, "cdr", qos, self._schemas[topic_type.kind]))
        defined = _bytes(*records)
        self._preamble += defined
        for waiting in self._waiting.values():
            waiting.extend(defined)
        return channel

    def _drop(self, subscriber: socket.socket) -> None:
        del self._waiting[subscriber]
        subscriber.close()


def _bytes(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()
