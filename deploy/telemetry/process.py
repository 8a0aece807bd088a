"""The process that writes a run's telemetry, started by `deploy/log.py`.

It reads records from standard input until its end, which also comes if the control loop is killed, and then
closes the log and the feed. Write errors are reported at once on standard error, and to the loop on standard
output. It does not import NumPy: it starts while the robot waits.
"""

import json
import os
import select
import socket
import sys
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from footfall.common.locks import locked
from footfall.deploy.log_records import START, take_records
from footfall.deploy.log_store import LogStore, lock_name, next_part
from footfall.deploy.telemetry.encoder import GONE, Encoder
from footfall.deploy.telemetry.feed import Feed
from footfall.deploy.telemetry.mcap_file import McapFile
from footfall.deploy.telemetry.topics import TOPICS

FLUSH_EVERY_S = 0.05
READ_BYTES = 1 << 20
READY = "ready"
NONE = "-"  # instead of a file descriptor
LAST_WAIT_S = 1.0  # for subscribers, after the end of the run


class Parts:
    """The parts of a log in a store: the current one and earlier ones."""

    def __init__(self, store: LogStore, path: Path) -> None:
        self._store, self.path = store, path
        self._held = ExitStack()
        self._latched: dict[str, tuple[int, bytes]] = {}

    def remember(self, topic: str, time_ns: int, message: bytes) -> None:
        """Keep the last message of a latched topic: each part starts with it."""
        if TOPICS[topic].latched:
            self._latched[topic] = time_ns, message

    def full(self, file: McapFile) -> bool:
        """Whether a file has reached the maximum size of a part."""
        return file.size > self._store.part_bytes

    def open_next(self, metadata: dict[str, str]) -> McapFile:
        """Open the next part after making room for it.

        Raises:
            OSError: it cannot be written.
        """
        self._store.make_room()
        self.path = next_part(self.path)
        file = McapFile(self.path.open("xb"), metadata)
        self._held.close()
        self._held.enter_context(locked(lock_name(self.path), f"the log {self.path}"))
        for topic, (time_ns, message) in self._latched.items():
            file.put(topic, time_ns, message)
        return file


class Sinks:
    """A log, a feed, or both. If the log fails, the feed continues."""

    def __init__(self, file: int | None, feed: int | None, begin: dict[str, Any]) -> None:
        """Start without having written anything.

        Args:
            file: descriptor of the log's file.
            feed: descriptor of the feed's listening socket.
            begin: content of the first record.
        """
        self._path, self._metadata = begin["path"], begin["metadata"]
        self._parts: Parts | None = None
        if begin["store"] is not None:
            folder, max_bytes = begin["store"]
            self._parts = Parts(LogStore(Path(folder), max_bytes), Path(self._path))
        self._file: McapFile | None = None
        self._file_full = False  # the next message begins another part
        self.feed = None if feed is None else Feed(socket.socket(fileno=feed), begin["metadata"])
        self.failed = False  # whether writing the log failed
        if file is not None:
            try:
                self._file = McapFile(os.fdopen(file, "wb"), begin["metadata"])
            except OSError as error:
                self._fail(error)

    def put(self, topic: str, time_ns: int, message: bytes) -> None:
        """Write a message to the log and the feed."""
        if self.feed is not None:
            self.feed.put(topic, time_ns, message)
        if self._file is not None:
            try:
                if self._file_full and self._parts is not None:
                    self._file.finish(complete=False)
                    self._file.close()
                    self._file, self._file_full = self._parts.open_next(self._metadata), False
                self._file.put(topic, time_ns, message)
                if self._parts is not None:
                    self._parts.remember(topic, time_ns, message)
            except OSError as error:
                self._fail(error)

    @property
    def part_full(self) -> bool:
        """Whether the current part has reached its maximum size, before the flush that notes it."""
        if self._file is None or self._parts is None or self._file_full:
            return False
        return self._parts.full(self._file)

    def flush(self) -> None:
        """Write buffered data to the disk; a full part ends before the next message."""
        if self._file is not None:
            try:
                self._file.flush()
                self._file_full = self._parts is not None and self._parts.full(self._file)
            except OSError as error:
                self._fail(error)

    def end(self, complete: bool) -> None:
        """Close the log and the feed; `complete` tells whether the run ended properly."""
        if self._file is not None:
            try:
                self._file.finish(complete)
            except OSError as error:
                self._fail(error)
        if self.feed is not None:
            self.feed.end(complete, LAST_WAIT_S)

    def _fail(self, error: OSError) -> None:
        reason = error.strerror or str(error)
        print(reason, flush=True)
        print(f"footfall: cannot write the log {self._path}: {reason}; the run goes on", file=sys.stderr)
        self._file, self.failed = None, True


def pass_on(source: int, sinks: Sinks, begin: dict[str, Any], arrived: bytearray) -> None:
    """Encode the records from a pipe until its end."""
    encoder = Encoder(begin, sinks.put)
    flush_at = time.monotonic() + FLUSH_EVERY_S
    while True:
        for kind, now_us, content in take_records(arrived):
            encoder.encode(kind, now_us, content)
            if sinks.part_full:  # if this process is slow, there may be many records to encode
                sinks.flush()
        if time.monotonic() >= flush_at:
            sinks.flush()
            flush_at = time.monotonic() + FLUSH_EVERY_S
        if not _readable(source, sinks.feed, max(0.0, flush_at - time.monotonic())):
            continue
        data = os.read(source, READ_BYTES)
        if not data:
            break
        arrived += data
    encoder.end()
    sinks.end(encoder.complete)
    if not encoder.complete:
        remainder = "" if begin["path"] is None else f"; {begin['path']} has everything before that"
        print(
            f"footfall: {GONE}, in state {encoder.state}: motors are off after their timeout{remainder}",
            file=sys.stderr,
        )


def _readable(source: int, feed: Feed | None, wait_s: float) -> bool:
    """Serve the feed and wait for records; returns whether there are any, or the pipe has ended."""
    if feed is None:
        return bool(select.select([source], [], [], wait_s)[0])
    feed.serve()
    readable: list[int | socket.socket] = [source, *feed.readable]
    return source in select.select(readable, feed.writable, [], wait_s)[0]


def first_record(source: int, arrived: bytearray) -> dict[str, Any] | None:
    """Content of the first record of a run, with `start_ns`; None if the pipe ends before it."""
    while True:
        for _, _, content in take_records(arrived):
            (start_ns,) = START.unpack_from(content)
            return {**json.loads(content[START.size :]), "start_ns": start_ns}
        data = os.read(source, READ_BYTES)
        if not data:
            return None
        arrived += data


def main() -> int:
    source, arrived = sys.stdin.fileno(), bytearray()
    file, feed = (None if each == NONE else int(each) for each in sys.argv[1:3])
    print(READY, flush=True)
    begin = first_record(source, arrived)
    if begin is None:
        return 0
    sinks = Sinks(file, feed, begin)
    pass_on(source, sinks, begin, arrived)
    if sinks.failed:
        os._exit(1)  # buffered data cannot be written either
    return 0


if __name__ == "__main__":
    sys.exit(main())
