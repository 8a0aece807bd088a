"""The feed: a run's messages over a Unix socket, to any number of programs that look on.

A subscriber connects and reads. What it reads is an MCAP stream without chunks (https://mcap.dev/spec), so
any reader of MCAP streams understands it, and what is saved from the socket is an MCAP file:

    magic, Header, Metadata "footfall" (as in a log), then Schema, Channel and Message records as they come,
    and after an orderly end of the run DataEnd, Footer, magic

- A Schema and a Channel stand before the first message of their topic. Messages are in CDR (`ros2msg`);
  topics, types and quality of service are those of `topics.py`. A record is one byte of opcode, eight of
  length (little-endian) and its content; `feed_reader.py` reads it with the standard library alone.
- A new subscriber first gets the last message of each latched topic.
- `sequence` counts the messages of a channel. A gap tells a subscriber that it was too slow: messages that do
  not fit into its buffer are left out. If a latched one would be, the subscriber is disconnected.
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

MOST_SUBSCRIBERS = 16
MOST_WAITING_BYTES = 2 * 2**20  # for each subscriber: some seconds
MESSAGE = struct.Struct("<BQHIQQ")  # opcode, bytes that follow, channel, sequence, log time, publish time
_MESSAGE_OPCODE, _REST = 0x05, MESSAGE.size - 9


def listen(path: Path) -> socket.socket:
    """The socket of a feed, which only this user may connect to. A dead feed's file is replaced.

    Raises:
        UserError: the socket cannot be made, or a run serves it.
    """
    found = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        _remove_dead(path)
        before = os.umask(0o077)
        try:
            found.bind(os.fspath(path))
        finally:
            os.umask(before)
        found.listen(MOST_SUBSCRIBERS)
    except OSError as error:
        found.close()
        raise UserError(f"cannot serve a feed at {path}: {error.strerror or error}") from None
    return found


def _remove_dead(path: Path) -> None:
    """Remove the socket of a process that is gone."""
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
    """Passes messages on to subscribers, and never waits for one."""

    def __init__(self, listener: socket.socket, metadata: dict[str, str]) -> None:
        self._listener = listener
        listener.setblocking(False)
        self._begin = MCAP0_MAGIC + _bytes(Header("ros2", "footfall"), Metadata(METADATA, metadata))
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._sent: list[int] = []  # messages of each channel
        self._latest: dict[str, bytes] = {}  # the last message of each latched topic
        self._waiting: dict[socket.socket, bytearray] = {}  # by subscriber

    @property
    def readable(self) -> list[socket.socket]:
        """Sockets that `serve` has something to do for once they are readable."""
        return [self._listener, *self._waiting]

    @property
    def writable(self) -> list[socket.socket]:
        """Those once they are writable."""
        return [each for each, waiting in self._waiting.items() if waiting]

    def put(self, topic: str, time_ns: int, message: bytes) -> None:
        """Pass on a message."""
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
            if len(waiting) + len(record) <= MOST_WAITING_BYTES:
                waiting.extend(record)
            elif latched:
                self._drop(subscriber)

    def serve(self) -> None:
        """Take new subscribers, and send what waits, as far as it goes at once."""
        self._accept()
        for subscriber, waiting in list(self._waiting.items()):
            try:
                with suppress(BlockingIOError):
                    if waiting:
                        del waiting[: subscriber.send(waiting)]
                with suppress(BlockingIOError):
                    subscriber.recv(1)  # it has ended, or sent what it must not
                    self._drop(subscriber)
            except OSError:
                self._drop(subscriber)

    def end(self, complete: bool, patience_s: float) -> None:
        """End the feed: what waits is sent to subscribers that take it within a time."""
        if complete:
            for waiting in self._waiting.values():
                waiting.extend(_bytes(DataEnd(0), Footer(0, 0, 0)) + MCAP0_MAGIC)
        until = time.monotonic() + patience_s
        while self.writable and (left := until - time.monotonic()) > 0.0:
            select.select([], self.writable, [], left)
            self.serve()
        for subscriber in list(self._waiting):
            self._drop(subscriber)
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            subscriber, _ = self._listener.accept()
            if len(self._waiting) == MOST_SUBSCRIBERS:
                subscriber.close()
                return
            subscriber.setblocking(False)
            self._waiting[subscriber] = bytearray(self._begin + b"".join(self._latest.values()))

    def _register(self, topic: str) -> int:
        """Define a topic, for subscribers of now and later ones."""
        how, records = TOPICS[topic], list[McapRecord]()
        if how.kind not in self._schemas:
            number = self._schemas[how.kind] = len(self._schemas) + 1
            schema = Schema(number, definition(how.kind).encode(), "ros2msg", how.kind)
            records.append(schema)
        channel = self._channels[topic] = len(self._sent)
        self._sent.append(0)
        qos = {"offered_qos_profiles": how.qos_profile}
        records.append(Channel(channel, topic, "cdr", qos, self._schemas[how.kind]))
        defined = _bytes(*records)
        self._begin += defined
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
