"""A log's numbers as arrays over time. Messages of a topic have the same length, and end in their numbers."""

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.log_file import LogFile, read_log

RECORDED_BUS = "recording"  # bus of a log that `footfall log import` made: its commands are not rounded
TEXTS = ("/state", "/notes", "/orders", "/policy/changes")
NUMBERS = {  # topics whose messages end in numbers of float64
    "/joint_states", "/joint_commands", "/joint_gains", "/reading_ages", "/imu/data", "/motor_health",
    "/cmd_vel", "/odom", "/contacts", "/foot_forces", "/loop_timing",
    "/policy/command",
}  # fmt: skip


class Column(NamedTuple):
    """Messages of one topic."""

    time_s: np.ndarray  # (T,) since the run's start
    values: np.ndarray  # (T, k)


class Event(NamedTuple):
    """A change of state, policy or request."""

    time_s: float
    topic: str
    text: str


@dataclass(frozen=True)
class LogColumns:
    """A run's log as arrays. A topic that the log lacks has no rows."""

    log: LogFile  # without messages
    start_ns: int
    end_ns: int
    counts: dict[str, int]  # messages by topic
    events: tuple[Event, ...]
    columns: dict[str, Column] = field(repr=False)

    @property
    def duration_s(self) -> float:
        """From the first message to the last."""
        return (self.end_ns - self.start_ns) * 1e-9

    @property
    def joints(self) -> list[str]:
        """The joints' names."""
        return self.log.joints

    def column(self, topic: str, numbers: int) -> Column:
        """The last `numbers` numbers of each of a topic's messages."""
        found = self.columns.get(topic, Column(np.zeros(0), np.zeros((0, numbers))))
        if found.values.shape[1] < numbers:
            raise UserError(f"{self.log.path}: messages of {topic} are shorter than those of a footfall run")
        return Column(found.time_s, found.values[:, found.values.shape[1] - numbers :])

    @cached_property
    def readings(self) -> Column:
        """Joint positions, velocities and torques as the motors reported them, (T, 3n)."""
        return self._joint_states("/joint_states")

    @cached_property
    def targets(self) -> Column:
        """Position and velocity targets and feed-forward torques that went out, (T, 3n)."""
        return self._joint_states("/joint_commands")

    def _joint_states(self, topic: str) -> Column:
        """Before each of three sequences stands its length, padded to eight bytes."""
        count = len(self.joints)
        time_s, values = self.column(topic, 3 * count + 2)
        return Column(time_s, np.delete(values, [count, 2 * count + 1], axis=1))

    def states(self) -> list[tuple[str, float, float]]:
        """Mode, start and end of each stretch, s."""
        changes = [
            (event.text.partition(":")[0], event.time_s) for event in self.events if event.topic == "/state"
        ]
        ends = [time_s for _, time_s in changes[1:]] + [self.duration_s]
        return [(mode, start, end) for (mode, start), end in zip(changes, ends, strict=False)]


def read_columns(path: Path) -> LogColumns:
    """Read a log's arrays.

    Raises:
        UserError: the log cannot be read, or holds no messages.
    """
    log = read_log(path, decoded=False)
    if not log.entries:
        raise UserError(f"{path} holds no messages")
    start_ns = min(entry.time_ns for entry in log.entries)
    end_ns = max(entry.time_ns for entry in log.entries)
    contents: dict[str, list[tuple[int, bytes]]] = {}
    events = []
    for topic, time_ns, content in log.entries:
        if topic in NUMBERS:
            contents.setdefault(topic, []).append((time_ns, content))
        elif topic in TEXTS:
            text = content[8:-1].decode(errors="replace")
            events.append(Event((time_ns - start_ns) * 1e-9, topic, text))
    return LogColumns(
        log=LogFile(log.path, log.metadata, (), log.complete, log.damaged),
        start_ns=start_ns,
        end_ns=end_ns,
        counts=dict(Counter(entry.topic for entry in log.entries)),
        events=tuple(events),
        columns={topic: _column(rows, start_ns) for topic, rows in contents.items()},
    )


def _column(rows: list[tuple[int, bytes]], start_ns: int) -> Column:
    """The numbers at the ends of messages; messages of an unusual length are left out."""
    ((size, _),) = Counter(len(content) for _, content in rows).most_common(1)
    usual = [(time_ns, content) for time_ns, content in rows if len(content) == size]
    numbers = (size - 4) // 8
    values = np.frombuffer(b"".join(content[size - 8 * numbers :] for _, content in usual), "<f8")
    times = np.array([time_ns for time_ns, _ in usual])
    return Column((times - start_ns) * 1e-9, values.reshape(-1, numbers))
