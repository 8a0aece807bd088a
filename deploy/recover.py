"""Copies logs: a truncated or damaged log gets an end, and a long log is cut to a time range."""

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

from footfall.common.errors import UserError
from footfall.deploy.log_file import Damage, definitions_first, records
from footfall.deploy.telemetry.mcap_file import ENDED, METADATA

CUT = "cut_s"  # metadata: start and end in the original log


class LogCopy(NamedTuple):
    """Content of a copy."""

    messages: int
    damaged: int  # number of parts and messages that could not be read and are skipped


def recover(damaged_log: Path, out: Path) -> LogCopy:
    """Copy the readable part of a log into a complete file.

    Raises:
        UserError: the log cannot be read, or the copy cannot be written.
    """
    damage = Damage()
    return _copy(_read(damaged_log, out, damage), out, damage)


def cut(path: Path, out: Path, from_s: float, to_s: float) -> LogCopy:
    """Copy a time range of a log. It begins with the last earlier message of each latched topic.

    Args:
        path: log to cut.
        out: copy to write.
        from_s, to_s: seconds since the log's first message.

    Raises:
        UserError: the log cannot be read, the range has no messages, or the copy cannot be written.
    """
    from mcap.records import Message

    damage = Damage()
    log_records = _read(path, out, damage)
    times = [record.log_time for record in log_records if isinstance(record, Message)]
    if not times:
        raise UserError(f"{path} has no messages")
    first, last = min(times), max(times)
    start_ns, end_ns = first + round(from_s * 1e9), first + round(min(to_s, 1e9) * 1e9)
    if not any(start_ns <= time <= end_ns for time in times):
        raise UserError(
            f"{path} is {(last - first) * 1e-9:.3f} s long: it has nothing from {from_s:g} to {to_s:g} s"
        )
    return _copy(_within(log_records, start_ns, end_ns, end_ns >= last, (from_s, to_s)), out, damage)


def _within(
    log_records: list[Any], start_ns: int, end_ns: int, includes_end: bool, span: tuple[float, float]
) -> list[Any]:
    """Records of a time range, including those without a time."""
    from mcap.records import Channel, Message, Metadata

    latched = {
        record.id
        for record in log_records
        if isinstance(record, Channel) and "transient_local" in str(record.metadata)
    }
    latest: dict[int, Message] = {}
    kept: list[Any] = []
    for record in log_records:
        if isinstance(record, Metadata) and record.name == METADATA and ENDED in record.metadata:
            if includes_end:
                kept.append(record)
        elif not isinstance(record, Message) or start_ns <= record.log_time <= end_ns:
            kept.append(record)
        elif record.log_time < start_ns and record.channel_id in latched:
            latest[record.channel_id] = record
    for record in latest.values():
        record.log_time = start_ns
    return [Metadata(METADATA, {CUT: json.dumps(span)}), *latest.values(), *kept]


def _read(path: Path, out: Path, damage: Damage) -> list[Any]:
    if out.exists() and out.samefile(path):
        raise UserError(f"{out} is the log itself: give another file for its copy")
    return list(records(path, damage))


def _copy(log_records: Iterable[Any], out: Path, damage: Damage) -> LogCopy:
    from mcap.records import Channel, Header, Message, Metadata, Schema
    from mcap.writer import Writer

    log_records = definitions_first(log_records)
    count = 0
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    header = next((record for record in log_records if isinstance(record, Header)), Header("", ""))
    try:
        with out.open("wb") as file:
            writer = Writer(file)
            writer.start(header.profile, header.library)
            for record in log_records:
                if isinstance(record, Metadata):
                    writer.add_metadata(record.name, record.metadata)
                elif isinstance(record, Schema) and record.id not in schemas:
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                elif isinstance(record, Channel) and record.id not in channels:
                    if record.schema_id in schemas:
                        channels[record.id] = _register(writer, record, schemas[record.schema_id])
                elif isinstance(record, Message):
                    if record.channel_id not in channels:
                        damage.parts += 1
                        continue
                    count += 1
                    writer.add_message(
                        channels[record.channel_id],
                        record.log_time,
                        record.data,
                        record.publish_time,
                        record.sequence,
                    )
            writer.finish()
    except OSError as error:
        raise UserError(f"cannot write {out}: {error.strerror or error}") from None
    return LogCopy(count, damage.parts)


def _register(writer: Any, channel: Any, schema: int) -> int:
    """Register a channel of a log in its copy; returns its new number."""
    number: int = writer.register_channel(channel.topic, channel.message_encoding, schema, channel.metadata)
    return number
