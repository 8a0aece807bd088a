"""Metrics of a run: TensorBoard events, and the same numbers as lines of JSON."""

import errno
import json
import os
import time
from pathlib import Path

from tensorboard.compat.proto.event_pb2 import Event, SessionLog
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.record_writer import RecordWriter

from footfall.common.errors import CannotWriteError
from footfall.common.files import write_atomically


class MetricsLog:
    """Writes scalars; a resumed run deletes the steps that it will compute again.

    A call returns when its record is handed to the operating system; nothing waits in a queue. A record that
    does not fit on a full disk leaves no part behind.
    """

    def __init__(self, folder: Path, steps_done: int) -> None:
        """
        Raises:
            CannotWriteError: the folder cannot be written.
        """
        self._path = folder / "metrics.jsonl"
        try:
            self._keep_up_to(steps_done)
            self._lines = _WholeRecords(self._path)
            (folder / "events").mkdir(exist_ok=True)
            events = _WholeRecords(folder / "events" / f"events.out.tfevents.{time.time_ns()}")
            self._events = RecordWriter(events)
            self._write_event(Event(file_version="brain.Event:2"))
            if steps_done:  # TensorBoard then drops later steps of the interrupted run
                restarted = SessionLog(status=SessionLog.START)
                self._write_event(Event(step=steps_done + 1, session_log=restarted))
        except OSError as error:
            raise self._refusal(error) from None

    def write(self, step: int, metrics: dict[str, float]) -> None:
        """Record the scalars of one iteration, which ended at environment step `step`.

        Raises:
            CannotWriteError: the disk is full; earlier records are whole.
        """
        values = [Summary.Value(tag=name, simple_value=value) for name, value in metrics.items()]
        try:
            self._lines.write((json.dumps({"step": step, **metrics}) + "\n").encode())
            self._write_event(Event(step=step, summary=Summary(value=values)))
        except OSError as error:
            raise self._refusal(error) from None

    def close(self) -> None:
        self._lines.close()
        self._events.close()

    def _write_event(self, event: Event) -> None:
        event.wall_time = time.time()
        self._events.write(event.SerializeToString())

    def _refusal(self, error: OSError) -> CannotWriteError:
        return CannotWriteError(f"cannot write {self._path}: {error.strerror}")

    def _keep_up_to(self, steps_done: int) -> None:
        if not self._path.exists():
            return
        lines = self._path.read_text(encoding="utf-8").splitlines()
        kept = []
        for line in lines:
            try:
                if json.loads(line)["step"] <= steps_done:
                    kept.append(line)
            except (json.JSONDecodeError, KeyError):
                continue  # a line that a killed process did not finish
        if kept != lines:
            write_atomically(self._path, "".join(line + "\n" for line in kept).encode())


class _WholeRecords:
    """A file that grows by whole records: one that does not fit is removed."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("ab", buffering=0)

    def write(self, record: bytes) -> None:
        end = self._file.seek(0, os.SEEK_END)
        try:
            if self._file.write(record) != len(record):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError:
            self._file.truncate(end)
            raise

    def close(self) -> None:
        self._file.close()
