"""Reader of a run's log, complete, truncated or damaged."""

import json
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import redirect_stderr
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

from footfall.common.errors import UserError
from footfall.deploy.telemetry.mcap_file import ENDED, METADATA

Decoder = Callable[[bytes], Any]

RENAMED = {"/imu": "/imu/data"}  # topics with other names in older logs
LARGEST_RECORD = 2**26  # bytes; limits a damaged length


class Entry(NamedTuple):
    """One message of a log."""

    topic: str
    time_ns: int
    message: Any  # decoded, with fields as attributes; or the encoded bytes


@dataclass(frozen=True)
class LogFile:
    """Metadata and messages of a log."""

    path: Path
    metadata: dict[str, Any]
    entries: tuple[Entry, ...]
    complete: bool  # False for a truncated run
    damaged: int  # number of parts and messages that could not be read

    def text(self, name: str) -> str:
        """Text entry of the metadata; raises UserError if it is missing."""
        value = self.metadata.get(name)
        if not isinstance(value, str):
            raise UserError(f"{self.path} has no {name.replace('_', ' ')} in its metadata")
        return value

    @property
    def joints(self) -> list[str]:
        """Names of the joints; raises UserError if they are missing."""
        joints = self.metadata.get("joints")
        if not isinstance(joints, list) or not joints or not all(isinstance(each, str) for each in joints):
            raise UserError(f"{self.path} has no joints in its metadata")
        return joints

    @property
    def foot_sensors(self) -> int:
        """Number of force sensors at the feet; 0 in logs without this entry."""
        found = self.metadata.get("foot_sensors", 0)
        return found if isinstance(found, int) and found > 0 else 0


@dataclass
class Damage:
    """Counts the parts of a file that could not be read."""

    parts: int = 0


def read_log(path: Path, topics: Collection[str] | None = None, decoded: bool = True) -> LogFile:
    """Read a log, even if its writer was killed. Damaged parts are skipped and counted.

    Args:
        path: the file.
        topics: topics to read (default: all).
        decoded: decode the messages; False returns their bytes, which is a hundred times faster.

    Raises:
        UserError: the file cannot be read, is not MCAP, or is not the log of a run.
    """
    from mcap.records import Channel, Message, Metadata, Schema

    decoders: dict[int, Decoder | None] = {}  # by channel; None if its messages cannot be decoded
    metadata: dict[str, Any] = {}
    entries: list[Entry] = []
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    damage = Damage()
    for record in definitions_first(records(path, damage)):
        try:
            if isinstance(record, Metadata) and record.name == METADATA:
                metadata.update({key: json.loads(value) for key, value in record.metadata.items()})
            elif isinstance(record, Schema):
                schemas[record.id] = record
            elif isinstance(record, Channel):
                channels[record.id] = record
            elif isinstance(record, Message):
                channel = channels[record.channel_id]
                topic = RENAMED.get(channel.topic, channel.topic)
                if topics is None or topic in topics:
                    if channel.id not in decoders:
                        decoders[channel.id] = _decoder(channel, schemas) if decoded else bytes
                    decode = decoders[channel.id]
                    if decode is None:
                        damage.parts += 1
                    else:
                        entries.append(Entry(topic, record.log_time, decode(record.data)))
        except (Exception, RecursionError):  # a decoder fails in many ways on damaged bytes
            damage.parts += 1
    if not metadata:
        raise UserError(f"{path} is not the log of a footfall run: it has no metadata '{METADATA}'")
    return LogFile(path, metadata, tuple(entries), metadata.pop(ENDED, False) is True, damage.parts)


def _decoder(channel: Any, schemas: dict[int, Any]) -> Decoder | None:
    """Decoding function for a channel's messages; None if there is none."""
    from mcap_ros2.decoder import DecoderFactory

    try:
        with redirect_stderr(StringIO()):  # its warnings about unsupported definitions
            return DecoderFactory().decoder_for(channel.message_encoding, schemas[channel.schema_id])
    except (Exception, RecursionError):
        return None


def definitions_first(all_records: Iterable[Any]) -> list[Any]:
    """Records with the definitions of messages first, each kind in its order.

    A definition comes before the first message that needs it, and again at the end of a file: so a lost
    chunk, even the first one with nearly all definitions, affects only its own messages.
    """
    from mcap.records import Channel, Schema

    return sorted(all_records, key=lambda record: not isinstance(record, (Schema, Channel)))


def records(path: Path, damage: Damage) -> Iterator[Any]:
    """Records of an MCAP file in their order, up to its end or its truncation.

    A chunk with a wrong checksum is skipped.

    Raises:
        UserError: the file cannot be read or is not MCAP.
    """
    from mcap.records import Chunk
    from mcap.stream_reader import StreamReader, breakup_chunk

    try:
        file = path.open("rb")
    except OSError as error:
        raise UserError(f"cannot read the log {path}: {error.strerror or error}") from None
    with file:
        reader = StreamReader(file, emit_chunks=True, record_size_limit=LARGEST_RECORD)
        source, started = iter(reader.records), False
        while True:
            try:
                record = next(source)
            except StopIteration:
                return
            except Exception:  # a truncated file fails in many ways
                if not started:
                    raise UserError(f"{path} is not an MCAP file") from None
                return
            started = True
            if not isinstance(record, Chunk):
                yield record
                continue
            try:
                if record.uncompressed_size > LARGEST_RECORD:
                    raise ValueError
                contents = breakup_chunk(record, validate_crc=True)
            except Exception:  # the exceptions depend on the decompressor
                damage.parts += 1
                continue
            yield from contents
