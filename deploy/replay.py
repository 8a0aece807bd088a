"""Reads a run's log back, complete or cut short, and feeds its readings to a policy again."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.log import METADATA, unflatten
from footfall.policies.policy import Policy
from footfall.robots.actuator import JointCommand

LARGEST_RECORD = 2**28  # bytes; a torn length field may claim anything


class Entry(NamedTuple):
    """One message of a log."""

    topic: str
    time_ns: int
    message: Any  # decoded; fields as attributes


@dataclass(frozen=True)
class LogFile:
    """A log's metadata and messages."""

    metadata: dict[str, Any]
    entries: tuple[Entry, ...]
    complete: bool  # False if the run was cut short


@dataclass(frozen=True)
class Replay:
    """How a policy's decisions compare with those in a log."""

    steps: int
    complete: bool  # whether the log has its end
    worst_difference: float  # largest absolute difference of any number decided; inf where one is none
    first_difference: str  # where the first one is, in words; empty if every number is the same


def read_log(path: Path) -> LogFile:
    """Read a log, also one whose writer was killed.

    Raises:
        UserError: the file cannot be read, is no MCAP or no log of a run.
    """
    from mcap.records import Channel, Footer, Message, Metadata, Schema
    from mcap_ros2.decoder import DecoderFactory

    decoders = DecoderFactory()
    metadata: dict[str, Any] = {}
    entries: list[Entry] = []
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    complete = False
    for record in records(path):
        if isinstance(record, Metadata) and record.name == METADATA:
            metadata.update({key: json.loads(value) for key, value in record.metadata.items()})
        elif isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            channel = channels[record.channel_id]
            decode = decoders.decoder_for(channel.message_encoding, schemas[channel.schema_id])
            if decode is not None:
                entries.append(Entry(channel.topic, record.log_time, decode(record.data)))
        elif isinstance(record, Footer):
            complete = True
    if not metadata:
        raise UserError(f"{path} is no log of a footfall run: it has no metadata '{METADATA}'")
    return LogFile(metadata, tuple(entries), complete)


def replay(path: Path, policy: Policy, tolerance: float = 0.0) -> Replay:
    """Hand a policy what the log's policy was handed; compare what it decides.

    Args:
        path: the log.
        policy: usually the same one.
        tolerance: differences up to this are not reported.

    Raises:
        UserError: the log cannot be read, holds no policy steps, or is another robot's; the tolerance is
            no number from 0.
    """
    if not 0.0 <= tolerance < math.inf:
        raise UserError(f"tolerance is {tolerance:g}: it must be a number from 0")
    log = read_log(path)
    inputs = [entry for entry in log.entries if entry.topic == "/policy/inputs"]
    decided = [entry for entry in log.entries if entry.topic == "/policy/command"]
    if not decided:
        raise UserError(f"{path} holds no policy steps: the run ended before it walked")
    joints = log.metadata["joints"]
    worst, first = 0.0, ""
    for index, (handed, answer) in enumerate(zip(inputs, decided, strict=False)):
        observation = unflatten(np.array(handed.message.data))
        if index == 0:
            policy.reset(observation)
        again = np.concatenate(policy.act(observation))
        before = np.array(answer.message.data)
        if again.shape != before.shape:
            raise UserError(f"{path} is of a robot with {len(joints)} joints: the policy does not fit")
        difference = _difference(again, before)
        worst = max(worst, float(difference.max()))
        if not first and difference.max() > tolerance:
            field, joint = divmod(int(difference.argmax()), len(joints))
            first = (
                f"step {index} ({observation.time_s:.3f} s): {JointCommand._fields[field]} of"
                f" {joints[joint]} was {before[difference.argmax()]:.9g},"
                f" is {again[difference.argmax()]:.9g}"
            )
    return Replay(len(decided), log.complete, worst, first)


def _difference(again: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Absolute differences of numbers; infinite where only one of the two is a number."""
    with np.errstate(invalid="ignore"):
        difference = np.abs(again - before)
    same = (again == before) | (np.isnan(again) & np.isnan(before))
    return np.where(same, 0.0, np.where(np.isnan(difference), np.inf, difference))


def records(path: Path) -> Iterator[Any]:
    """The records of an MCAP file in their order, up to its end or to where it was torn off.

    Raises:
        UserError: the file cannot be read or is no MCAP.
    """
    from mcap.stream_reader import StreamReader

    try:
        file = path.open("rb")
    except OSError as error:
        raise UserError(f"cannot read the log {path}: {error.strerror or error}") from None
    with file:
        source = iter(StreamReader(file, record_size_limit=LARGEST_RECORD).records)
        begun = False
        while True:
            try:
                record = next(source)
            except StopIteration:
                return
            except Exception:  # a torn end fails in as many ways as there are decompressors
                if not begun:
                    raise UserError(f"{path} is no MCAP file") from None
                return
            begun = True
            yield record
