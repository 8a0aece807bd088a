"""Damaged files, drawn from a seed."""

import io
from typing import Any

import numpy as np
import yaml
from mcap.records import Channel, DataEnd, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

NASTY: tuple[Any, ...] = (
    *(None, True, 0, 1, -1, 10**30, -1e-300, 1e308, float("nan"), float("inf"), -float("inf")),
    *("", "text", "1e400", "../..", "\0", "a\nb", "2026-02-30"),
    *([], {}, [[]], [1, 2], ["a"], {"a": 1}, [None], [float("nan")] * 3),
)


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """Bytes with up to a dozen positions changed, cut out, repeated, swapped or truncated."""
    data = bytearray(content)
    for _ in range(int(rng.integers(1, 13))):
        if not data:
            break
        kind, at = int(rng.integers(6)), int(rng.integers(len(data)))
        size = int(rng.integers(1, 33))
        if kind == 0:
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            data[at : at + size] = rng.bytes(size)
        elif kind == 2:
            del data[at : at + size]
        elif kind == 3:
            data[at:at] = data[at : at + size]
        elif kind == 4:
            data[at : at + 8] = (255 if rng.integers(2) else 0).to_bytes() * 8
        elif rng.integers(4) == 0:
            del data[at:]
    return bytes(data)


def mutated_records(content: bytes, rng: np.random.Generator) -> bytes:
    """A log with correct check sums and some wrong records."""
    output = io.BytesIO()
    writer = Writer(output)
    writer.start("ros2", "fuzz")
    share = 10.0 ** rng.uniform(-3, 0)
    for record in StreamReader(io.BytesIO(content)).records:
        damaged = rng.random() < share
        if isinstance(record, Metadata):
            values = {
                key: mutated(value.encode(), rng).decode(errors="replace") if damaged else value
                for key, value in record.metadata.items()
            }
            writer.add_metadata(record.name, values)
        elif isinstance(record, Schema):
            writer.register_schema(
                record.name, record.encoding, mutated(record.data, rng) if damaged else record.data
            )
        elif isinstance(record, Channel):
            topic = str(rng.choice(["/policy/inputs", "/imu/data", ""])) if damaged else record.topic
            schema = int(rng.integers(9)) if damaged else record.schema_id
            writer.register_channel(topic, record.message_encoding, schema)
        elif isinstance(record, Message):
            data = mutated(record.data, rng) if damaged else record.data
            writer.add_message(record.channel_id, record.log_time, data, record.publish_time)
        elif isinstance(record, DataEnd):
            break
    writer.finish()
    return output.getvalue()


def mutated_yaml(content: bytes, rng: np.random.Generator) -> bytes:
    """Settings with up to three values replaced, removed or added; in one of four the bytes are changed."""
    if rng.integers(4) == 0:
        return mutated(content, rng)
    data = yaml.safe_load(content)
    for _ in range(int(rng.integers(1, 4))):
        data = with_a_change(data, rng)
    return yaml.safe_dump(data).encode()


def with_a_change(data: Any, rng: np.random.Generator) -> Any:
    """Plain data with one random value changed, at any depth."""
    deeper = isinstance(data, dict | list) and len(data) > 0 and rng.integers(8) > 0
    if not deeper:
        return NASTY[int(rng.integers(len(NASTY)))]
    keys = list(data) if isinstance(data, dict) else range(len(data))
    key, kind = keys[int(rng.integers(len(keys)))], int(rng.integers(12))
    changed = data.copy()
    if kind == 0:
        del changed[key]
    elif kind == 1 and isinstance(changed, dict):
        changed["nobody_knows_this"] = data[key]
    elif kind == 1:
        changed.append(data[key])
    else:
        changed[key] = with_a_change(data[key], rng)
    return changed
