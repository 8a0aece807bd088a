"""The newest policy of a run, as an ONNX file: the finished one, or the newest checkpoint exported here.

Exporting needs the learning wing. It happens in another process, on the processor and at low priority, so
that neither the training nor the walk is held up by it.
"""

import multiprocessing
import os
import shutil
import signal
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import NamedTuple

from footfall.common.errors import UserError

NICENESS = 10


class Snapshot(NamedTuple):
    """A policy to look at."""

    path: Path
    iteration: int | None  # of the training; None where the run keeps no checkpoint


class Exported(NamedTuple):
    """What came of an export: a policy, or why there is none, in one line.

    Neither, if the training had dropped the checkpoint by then, in favour of a newer one.
    """

    policy: Path | None
    problem: str = ""


class Exporter:
    """A process that exports checkpoints, one at a time."""

    def __init__(self, run: Path) -> None:
        self._run = run
        self._process: multiprocessing.process.BaseProcess | None = None
        self._connection: Connection | None = None

    def wake(self) -> None:
        """Start the process, so that it is ready when there is something to export."""
        if self._process is None:
            context = multiprocessing.get_context("spawn")
            self._connection, theirs = context.Pipe()
            self._process = context.Process(target=_export_on_demand, args=(theirs,), daemon=True)
            self._process.start()
            theirs.close()  # so that the death of either side is noticed by the other

    def start(self, checkpoint: Path, out: Path) -> None:
        """Begin to export a checkpoint; ask for its end with `poll`."""
        self.wake()
        assert self._connection is not None
        with suppress(BrokenPipeError):  # then `poll` will tell
            self._connection.send((self._run, checkpoint, out))

    def poll(self) -> Exported | None:
        """What came of the export; None while it is under way."""
        assert self._connection is not None
        if not self._connection.poll():
            return None
        try:
            answer: Exported = self._connection.recv()
            return answer
        except (EOFError, ConnectionResetError):
            self.close()
            return Exported(None, "the process that exports it died")

    def close(self) -> None:
        """End the process."""
        if self._process is not None and self._connection is not None:
            self._connection.close()
            self._process.terminate()
            self._process.join()
            self._process = self._connection = None


class Snapshots:
    """Finds the newest policy of a run each time it is asked. Files go into `folder`."""

    def __init__(self, run: Path, folder: Path) -> None:
        self._run, self._folder = run, folder
        self._exporter = Exporter(run)
        self._under_way: Path | None = None
        self._seen: tuple[Path, int] | None = None  # the newest file that was handed out or did not do
        self.problem = ""  # why the newest checkpoint could not be used, in one line

    def newest(self) -> Snapshot | None:
        """A policy newer than the last one handed out, if there is one by now. Never waits."""
        if self._under_way is not None:
            return self._exported(self._under_way)
        source = _newest_source(self._run)
        if source is None:
            self._exporter.wake()
        if source is None or source == self._seen:
            return None
        self._seen, path = source, source[0]
        if path.suffix == ".onnx":
            self.problem = ""
            return Snapshot(path, _iteration(newest_checkpoint(self._run)))
        self._under_way = path
        self._exporter.start(path, self._out(path))
        return None

    def close(self) -> None:
        self._exporter.close()

    def _exported(self, checkpoint: Path) -> Snapshot | None:
        exported = self._exporter.poll()
        if exported is None:
            return None
        self._under_way, self.problem = None, exported.problem
        return None if exported.policy is None else Snapshot(exported.policy, _iteration(checkpoint))

    def _out(self, checkpoint: Path) -> Path:
        return self._folder / f"{checkpoint.stem}.onnx"


def newest_checkpoint(run: Path) -> Path | None:
    """The checkpoint with the highest number."""
    return max((run / "checkpoints").glob("[0-9]*.ckpt"), key=lambda path: int(path.stem), default=None)


def _newest_source(run: Path) -> tuple[Path, int] | None:
    """The finished policy or the newest checkpoint, whichever is newer, and its time of writing, ns."""
    dated = []
    for path in (newest_checkpoint(run), run / "policy.onnx"):
        if path is not None:
            with suppress(FileNotFoundError):  # a checkpoint that was dropped in favour of a newer one
                dated.append((path, path.stat().st_mtime_ns))
    return max(dated, key=lambda item: item[1], default=None)


def _iteration(checkpoint: Path | None) -> int | None:
    return None if checkpoint is None else int(checkpoint.stem)


def _export_on_demand(requests: Connection) -> None:
    """In the other process: answer each request until the first one ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the first process
    os.nice(max(0, NICENESS - os.nice(0)))
    os.environ["JAX_PLATFORMS"] = "cpu"
    from footfall.train.entry import learning_libraries

    with suppress(UserError), learning_libraries():
        import footfall.train.api  # noqa: F401  (takes seconds, spent before there is anything to do)
    with suppress(EOFError, KeyboardInterrupt):
        while True:
            requests.send(_export(*requests.recv()))


def _export(run: Path, checkpoint: Path, out: Path) -> Exported:
    """Export a checkpoint that the training may drop at any time: a copy of it, taken first."""
    from footfall.train.entry import learning_libraries

    copy = out.with_name(checkpoint.name)
    try:
        _take(checkpoint, copy)
    except FileNotFoundError:
        return Exported(None)
    except OSError as error:
        return Exported(None, " ".join(str(error).split()))
    try:
        with learning_libraries():
            from footfall.train.api import export_run
        return Exported(export_run(run, out, copy)[0])
    except (UserError, OSError) as error:
        return Exported(None, " ".join(str(error).replace(str(copy), str(checkpoint)).split()))
    finally:
        copy.unlink(missing_ok=True)


def _take(file: Path, copy: Path) -> None:
    """Another name for a file, or a copy on another file system."""
    copy.unlink(missing_ok=True)
    try:
        copy.hardlink_to(file)
    except FileNotFoundError:
        raise
    except OSError:
        shutil.copyfile(file, copy)
