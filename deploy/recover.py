"""Gives a log that was cut short its end, so that tools which need a file's index open it."""

from pathlib import Path

from footfall.common.errors import UserError
from footfall.deploy.replay import records


def recover(torn: Path, whole: Path) -> int:
    """Copy what is left of a log into a complete file; returns how many messages it holds.

    Raises:
        UserError: the log cannot be read or the copy not written.
    """
    from mcap.records import Channel, Header, Message, Metadata, Schema
    from mcap.writer import Writer

    if whole.exists() and whole.samefile(torn):
        raise UserError(f"{whole} is the log itself: give another file for its recovered copy")
    count = 0
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    found = list(records(torn))
    try:
        with whole.open("wb") as file:
            writer = Writer(file)
            for record in found:
                if isinstance(record, Header):
                    writer.start(record.profile, record.library)
                elif isinstance(record, Metadata):
                    writer.add_metadata(record.name, record.metadata)
                elif isinstance(record, Schema) and record.id not in schemas:
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                elif isinstance(record, Channel) and record.id not in channels:
                    channels[record.id] = writer.register_channel(
                        record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                    )
                elif isinstance(record, Message):
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
    return count
