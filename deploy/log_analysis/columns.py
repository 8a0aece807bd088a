"""Values of a log as arrays over time. Messages of a topic have the same length, and end with their
values."""

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.log_file import LogFile, read_log

RECORDED_BUS = "recording"  # bus of a log by `footfall log import`: its commands are not rounded
TEXTS = ("/state", "/notes", "/orders", "/policy/changes")
NUMBERS = {  # topics whose messages end with float64 values
    "/joint_states", "/joint_commands", "/joint_gains", "/reading_ages", "/imu/data", "/motor_health",
    "/cmd_vel", "/odom", "/contacts", "/foot_forces", "/loop_timing",
    "/policy/command",
}  # fmt: skip


class Column(NamedTuple):
    """Values of the messages of one topic."""

    time_s: np.ndarray  # (T,) since the start of the run
    values: np.ndarray  # (T, k)


class Event(NamedTuple):
    """A change of state, policy or request."""

    time_s: float
    topic: str
    text: str


@dataclass(frozen=True)
class LogColumns:
    """Log of a run as arrays. A topic missing in the log has no rows."""

    log: LogFile  # without messages
    start_ns: int
    end_ns: int
    counts: dict[str, int]  # messages by topic
    events: tuple[Event, ...]
    columns: dict[str, Column] = field(repr=False)

    @property
    def duration_s(self) -> float:
        """Time from the first message to the last."""
        return (self.end_ns - self.start_ns) * 1e-9

    @property
    def joints(self) -> list[str]:
        """Names of the joints."""
        return self.log.joints

    def column(self, topic: str, numbers: int) -> Column:
        """Last `numbers` values of each message of a topic."""
        column = self.columns.get(topic, Column(np.zeros(0), np.zeros((0, numbers))))
        if column.values.shape[1] < numbers:
            raise UserError(f"{self.log.path}: messages of {topic} are shorter than those of a footfall run")
        return Column(column.time_s, column.values[:, column.values.shape[1] - numbers :])

    @cached_property
    def readings(self) -> Column:
        """Joint positions, velocities and torques as reported by the motors, (T, 3n)."""
        return self._joint_states("/joint_states")

    @cached_property
    def targets(self) -> Column:
        """Position and velocity targets and feed-forward torques as sent, (T, 3n)."""
        return self._joint_states("/joint_commands")

    def _joint_states(self, topic: str) -> Column:
        """Values of three sequences; each starts with its length, padded to eight bytes."""
        count = len(self.joints)
        time_s, values = self.column(topic, 3 * count + 2)
        return Column(time_s, np.delete(values, [count, 2 * count + 1], axis=1))

    def states(self) -> list[tuple[str, float, float]]:
        """Mode, start and end of each interval, s."""
        changes = [
            (event.text.partition(":")[0], event.time_s) for event in self.events if event.topic == "/state"
        ]
        ends = [time_s for _, time_s in changes[1:]] + [self.duration_s]
        return [(mode, start, end) for (mode, start), end in zip(changes, ends, strict=False)]


def read_columns(path: Path) -> LogColumns:
    """Read a log's arrays.

    Raises:
        UserError: the log cannot be read, or has no messages.
    """
    log = read_log(path, decoded=False)
    if not log.entries:
        raise UserError(f"{path} has no messages")
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
    """Values at the ends of messages; messages with an unusual length are ignored."""
    ((size, _),) = Counter(len(content) for _, content in rows).most_common(1)
    complete = [(time_ns, content) for time_ns, content in rows if len(content) == size]
    numbers = (size - 4) // 8
    values = np.frombuffer(b"".join(content[size - 8 * numbers :] for _, content in complete), "<f8")
    times = np.array([time_ns for time_ns, _ in complete])
    return Column((times - start_ns) * 1e-9, values.reshape(-1, numbers))
