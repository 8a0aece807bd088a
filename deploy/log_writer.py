"""The process that writes a run's log, started by `deploy/log.py`.

It reads records from standard input until that ends, also because the control loop was killed, and gives the
file its index then. What cannot be written, it says at once on standard error, and to the loop on standard
output. No NumPy here: it starts while the robot waits.
"""

import json
import os
import select
import sys
import time
from typing import IO, Any

from mcap.writer import Writer

from footfall.deploy import messages
from footfall.deploy.log_records import Kind, take_records

METADATA = "footfall"
ENDED = "ended"  # metadata of a run that was not cut short
CHUNK_BYTES = 64 * 1024
FLUSH_EVERY_S = 0.05
READ_BYTES = 1 << 20
READY = "ready"
GONE = "the process of the run ended before the run"
ARRAYS = {  # records that are written unchanged: topic, bytes per number
    Kind.DECISION: ("/policy/command", 8),
    Kind.OBSERVATION: ("/policy/observation", 4),
    Kind.ACTION: ("/policy/action", 4),
    Kind.CONTACTS: ("/contacts", 8),
    Kind.AGES: ("/reading_ages", 8),
    Kind.HEALTH: ("/motor_health", 8),
    Kind.FOOTHOLDS: ("/footholds", 8),
}
TEXTS = {Kind.STATE: "/state", Kind.NOTE: "/notes"}


class LogWriter:
    """Turns records into MCAP messages."""

    def __init__(self, file: IO[bytes], begin: dict[str, Any]) -> None:
        """`begin` is the first record's content."""
        self._file = file
        self._names = tuple(begin["joints"])
        self._start_ns = begin["start_ns"]
        self._readings, self._inputs = begin["readings"], begin["inputs"]  # sizes of their parts
        self._size = 8 * len(self._names)  # bytes of a number for each joint
        self._last_ns = self._start_ns
        self.state = "no state"  # the supervisor's, as logged last
        self.complete = False  # whether the run has ended
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._writer = Writer(file, chunk_size=CHUNK_BYTES)
        self._writer.start(profile="ros2", library="footfall")
        self._writer.add_metadata(METADATA, begin["metadata"])
        self.flush()

    def write(self, kind: Kind, now_us: int, content: bytes) -> None:
        """Write one record."""
        time_ns = self._last_ns = self._start_ns + now_us * 1000
        if kind in ARRAYS:
            topic, size = ARRAYS[kind]
            self._array(topic, time_ns, content, size)
        elif kind in TEXTS:
            if kind is Kind.STATE:
                self.state = content.decode()
            self._put(TEXTS[kind], time_ns, messages.text(content.decode()))
        elif kind is Kind.READINGS:
            self._sensed(time_ns, _parts(content, self._readings))
        elif kind is Kind.COMMANDED:
            position, velocity, torque = (self._rows(content, row) for row in (0, 1, 4))
            joints = messages.joint_state(self._names)
            self._put("/joint_commands", time_ns, joints.fill(time_ns, position, velocity, torque))
            self._array("/joint_gains", time_ns, content[2 * self._size : 4 * self._size])
        elif kind is Kind.INPUTS:
            command = _parts(content, self._inputs)["command"]
            self._put("/cmd_vel", time_ns, messages.twist().fill(time_ns, command[:16], command[16:]))
            self._array("/policy/inputs", time_ns, content)
        elif kind is Kind.ODOMETRY:
            self._put("/odom", time_ns, messages.odometry().fill(time_ns, content))
        elif kind is Kind.END:
            self.complete = True
            self._writer.add_metadata(METADATA, {ENDED: "true"})

    def flush(self) -> None:
        """Flush everything to the file."""
        self._writer.flush()

    def finish(self) -> None:
        """Write the file's index, after a note if the run's process is gone without an end of the run."""
        if not self.complete:
            self._put(TEXTS[Kind.NOTE], self._last_ns, messages.text(GONE))
        self._writer.finish()
        self._file.flush()

    def _sensed(self, time_ns: int, part: dict[str, bytes]) -> None:
        joints = messages.joint_state(self._names)
        state = joints.fill(time_ns, part["joint_position"], part["joint_velocity"], part["joint_torque"])
        self._put("/joint_states", time_ns, state)
        w, xyz = part["quaternion"][:8], part["quaternion"][8:]
        self._put("/imu", time_ns, messages.imu().fill(time_ns, xyz, w, part["gyro"], part["acceleration"]))

    def _rows(self, content: bytes, row: int) -> bytes:
        return content[row * self._size : (row + 1) * self._size]

    def _array(self, topic: str, time_ns: int, content: bytes, size: int = 8) -> None:
        label = topic.rpartition("/")[2]
        self._put(topic, time_ns, messages.multi_array(label, len(content) // size, size).fill(0, content))

    def _put(self, topic: str, time_ns: int, message: bytes) -> None:
        if topic not in self._channels:
            kind = messages.TOPICS[topic]
            if kind not in self._schemas:
                text = messages.SCHEMAS[kind].encode()
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", text)
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind])
        self._writer.add_message(self._channels[topic], time_ns, message, time_ns)


def _parts(content: bytes, sizes: dict[str, int]) -> dict[str, bytes]:
    """The parts of a record of float64 by name, given the number of components of each in order."""
    parts, start = {}, 0
    for name, size in sizes.items():
        parts[name] = content[start : start + 8 * size]
        start += 8 * size
    return parts


def write_all(source: int, file: IO[bytes], begin: dict[str, Any], arrived: bytearray) -> None:
    """Write the records of a pipe until it ends, flushed often.

    Raises:
        OSError: the file cannot be written.
    """
    writer = LogWriter(file, begin)
    flush_at = time.monotonic() + FLUSH_EVERY_S
    while True:
        for kind, now_us, content in take_records(arrived):
            writer.write(kind, now_us, content)
        if time.monotonic() >= flush_at:
            writer.flush()
            flush_at = time.monotonic() + FLUSH_EVERY_S
        if select.select([source], [], [], max(0.0, flush_at - time.monotonic()))[0]:
            data = os.read(source, READ_BYTES)
            if not data:
                writer.finish()
                if not writer.complete:
                    print(
                        f"footfall: {GONE}, in state {writer.state}: motors are off after their timeout;"
                        f" {begin['path']} has what came before",
                        file=sys.stderr,
                    )
                return
            arrived += data


def first_record(source: int, arrived: bytearray) -> dict[str, Any] | None:
    """The content of the record that begins a log; None if the pipe ends before it."""
    while True:
        for _, _, content in take_records(arrived):
            return json.loads(content)
        data = os.read(source, READ_BYTES)
        if not data:
            return None
        arrived += data


def main() -> int:
    source, arrived = sys.stdin.fileno(), bytearray()
    file = os.fdopen(int(sys.argv[1]), "wb")
    print(READY, flush=True)
    begin = first_record(source, arrived)
    if begin is None:
        return 0
    try:
        write_all(source, file, begin, arrived)
    except OSError as error:
        reason = error.strerror or str(error)
        print(reason, flush=True)
        print(f"footfall: cannot write the log {begin['path']}: {reason}; the run goes on", file=sys.stderr)
        os._exit(1)  # buffered data cannot be written either
    return 0


if __name__ == "__main__":
    sys.exit(main())
