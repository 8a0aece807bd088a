"""Writes a run's messages to an MCAP file."""

from typing import IO

from mcap.writer import Writer

from footfall.deploy.telemetry.definitions import definition
from footfall.deploy.telemetry.topics import TOPICS

METADATA = "footfall"
ENDED = "ended"  # metadata of a run that ended properly
CHUNK_BYTES = 64 * 1024


class McapFile:
    """A log of messages, readable up to the last flush."""

    def __init__(self, file: IO[bytes], metadata: dict[str, str]) -> None:
        self._file = file
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._writer = Writer(file, chunk_size=CHUNK_BYTES)
        self._writer.start(profile="ros2", library="footfall")
        self._writer.add_metadata(METADATA, metadata)
        self.flush()

    def put(self, topic: str, time_ns: int, message: bytes) -> None:
        """Write a message."""
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._register(topic)
        self._writer.add_message(channel, time_ns, message, time_ns)

    def flush(self) -> None:
        """Write all buffered data to the file."""
        self._writer.flush()

    @property
    def size(self) -> int:
        """Number of bytes written so far."""
        return self._file.tell()

    def close(self) -> None:
        """Close the file; not done by `finish`."""
        self._file.close()

    def finish(self, complete: bool) -> None:
        """Write the file's index, and whether the run ended properly."""
        if complete:
            self._writer.add_metadata(METADATA, {ENDED: "true"})
        self._writer.finish()
        self._file.flush()

    def _register(self, topic: str) -> int:
        topic_type = TOPICS[topic]
        if topic_type.kind not in self._schemas:
            text = definition(topic_type.kind).encode()
            self._schemas[topic_type.kind] = self._writer.register_schema(topic_type.kind, "ros2msg", text)
        qos = {"offered_qos_profiles": topic_type.qos_profile}
        return self._writer.register_channel(topic, "cdr", self._schemas[topic_type.kind], qos)
