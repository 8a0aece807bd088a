"""Completes a log that was cut short or damaged: the copy has the index that other tools need."""

from pathlib import Path
from typing import Any, NamedTuple

from footfall.common.errors import UserError
from footfall.deploy.log_file import Damage, definitions_first, records


class Recovered(NamedTuple):
    """What a recovered copy holds."""

    messages: int
    damaged: int  # parts and messages that could not be read and are left out


def recover(torn: Path, whole: Path) -> Recovered:
    """Copy what is left of a log into a complete file.

    Raises:
        UserError: the log cannot be read or the copy not written.
    """
    from mcap.records import Channel, Header, Message, Metadata, Schema
    from mcap.writer import Writer

    if whole.exists() and whole.samefile(torn):
        raise UserError(f"{whole} is the log itself: give another file for its recovered copy")
    count, damage = 0, Damage()
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    found = definitions_first(records(torn, damage))
    header = next((each for each in found if isinstance(each, Header)), Header("", ""))
    try:
        with whole.open("wb") as file:
            writer = Writer(file)
            writer.start(header.profile, header.library)
            for record in found:
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
        raise UserError(f"cannot write {whole}: {error.strerror or error}") from None
    return Recovered(count, damage.parts)


def _register(writer: Any, channel: Any, schema: int) -> int:
    """A channel of a log in its copy; returns its new number."""
    number: int = writer.register_channel(channel.topic, channel.message_encoding, schema, channel.metadata)
    return number
