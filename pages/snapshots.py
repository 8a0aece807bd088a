"""A run's policies as ONNX files: the finished policy, and checkpoints, which are exported here.

Exporting needs JAX, and torch for a run of rsl_rl. It runs in another process, on the CPU and at low
priority, so that it delays neither the training nor the walk.
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
NEWEST, FINISHED = "newest", "policy.onnx"  # choices of a visitor besides single checkpoints


class Snapshot(NamedTuple):
    """A policy to show."""

    path: Path
    iteration: int | None  # of the training; None where the run keeps no checkpoint


class Exported(NamedTuple):
    """Result of an export: a policy, or the problem in one line.

    Both are empty if the training has deleted the checkpoint in the meantime.
    """

    policy: Path | None
    problem: str = ""


class DatedFile(NamedTuple):
    """A file and its modification time."""

    path: Path
    time_ns: int


class Exporter:
    """A process that exports checkpoints, one at a time."""

    def __init__(self, run: Path) -> None:
        self._run = run
        self._process: multiprocessing.process.BaseProcess | None = None
        self._connection: Connection | None = None

    def wake(self) -> None:
        """Start the process ahead of the first export."""
        if self._process is None:
            context = multiprocessing.get_context("spawn")
            self._connection, child_end = context.Pipe()
            self._process = context.Process(target=_export_on_demand, args=(child_end,), daemon=True)
            self._process.start()
            child_end.close()  # so that each side notices the end of the other

    def start(self, checkpoint: Path, out: Path) -> None:
        """Begin to export a checkpoint; `poll` returns the result."""
        self.wake()
        assert self._connection is not None
        with suppress(BrokenPipeError):  # `poll` reports it
            self._connection.send((self._run, checkpoint, out))

    def poll(self) -> Exported | None:
        """Result of the export; None while it runs."""
        assert self._connection is not None
        if not self._connection.poll():
            return None
        try:
            answer: Exported = self._connection.recv()
            return answer
        except (EOFError, ConnectionResetError):
            self.close()
            return Exported(None, "the exporting process died")

    def close(self) -> None:
        """End the process."""
        if self._process is not None and self._connection is not None:
            self._connection.close()
            self._process.terminate()
            self._process.join()
            self._process = self._connection = None


class Snapshots:
    """Finds the chosen policy of a run, at first the newest. Exported files go into `folder`."""

    def __init__(self, run: Path, folder: Path, exporter: Exporter | None = None) -> None:
        self._run, self._folder = run, folder
        self._exporter = exporter or Exporter(run)
        self._export: tuple[Path, str] | None = None  # the checkpoint, and the choice at that time
        self._last_source: DatedFile | None = None  # source of the last policy returned, or one that failed
        self.chosen = NEWEST
        self.problem = ""  # why a checkpoint could not be used, in one line

    def names(self) -> list[str]:
        """Choices: the newest, the finished policy, then checkpoints, newest first.

        Deleted checkpoints are included if they were exported here.
        """
        finished = [FINISHED] if (self._run / FINISHED).exists() else []
        return [NEWEST, *finished, *self._checkpoints()]

    def poll(self) -> Snapshot | None:
        """The chosen policy if it is ready and differs from the last one returned, else None. Never waits."""
        if self._export is not None:
            outcome = self._exporter.poll()
            if outcome is None:
                return None
            (checkpoint, chosen), self._export = self._export, None
            self.problem = outcome.problem
            if outcome.policy is not None and chosen == self.chosen:
                return Snapshot(outcome.policy, _iteration(checkpoint))
        source = self._source()
        if source is None:
            self._exporter.wake()
        if source is None or source == self._last_source:
            return None
        self._last_source = source  # a failed export is not tried again
        policy = self._policy_of(source)
        if policy is None:
            self._export = (source.path, self.chosen)
            self._exporter.start(source.path, self._exported_path(source.path))
            return None
        self.problem = ""
        finished = source.path.name == FINISHED
        return Snapshot(policy, _iteration(newest_checkpoint(self._run) if finished else source.path))

    @property
    def exporting(self) -> int | None:
        """Iteration of the checkpoint that is being exported, or None."""
        return None if self._export is None else _iteration(self._export[0])

    def close(self) -> None:
        self._exporter.close()

    def _source(self) -> DatedFile | None:
        """The file that contains the chosen policy: ONNX or checkpoint."""
        if self.chosen == NEWEST:
            return _newest(newest_checkpoint(self._run), self._run / FINISHED)
        if self.chosen == FINISHED:
            return _newest(self._run / FINISHED)
        checkpoint = self._checkpoints().get(self.chosen)
        return None if checkpoint is None else _newest(checkpoint)

    def _checkpoints(self) -> dict[str, Path]:
        """Checkpoints by name, newest first; an exported policy replaces a deleted checkpoint."""
        exported, kept = self._folder.glob("[0-9]*.onnx"), (self._run / "checkpoints").glob("[0-9]*.ckpt")
        files = {int(path.stem): path for path in (*exported, *kept)}
        return {_name(iteration): files[iteration] for iteration in sorted(files, reverse=True)}

    def _policy_of(self, source: DatedFile) -> Path | None:
        """The ONNX file of a source, if it exists."""
        if source.path.suffix == ".onnx":
            return source.path
        exported = _newest(self._exported_path(source.path))
        return exported.path if exported is not None and exported.time_ns >= source.time_ns else None

    def _exported_path(self, checkpoint: Path) -> Path:
        return self._folder / f"{checkpoint.stem}.onnx"


def newest_checkpoint(run: Path) -> Path | None:
    """The checkpoint with the highest number."""
    return max((run / "checkpoints").glob("[0-9]*.ckpt"), key=lambda path: int(path.stem), default=None)


def _newest(*paths: Path | None) -> DatedFile | None:
    """The most recently written of the existing files."""
    dated = []
    for path in paths:
        if path is not None:
            with suppress(FileNotFoundError):  # a checkpoint that was deleted after a newer one
                dated.append(DatedFile(path, path.stat().st_mtime_ns))
    return max(dated, key=lambda file: file.time_ns, default=None)


def _name(iteration: int) -> str:
    return f"iteration {iteration:,}"


def _iteration(checkpoint: Path | None) -> int | None:
    return None if checkpoint is None else int(checkpoint.stem)


def _export_on_demand(requests: Connection) -> None:
    """In the other process: answer requests until the first process ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the first process
    os.nice(max(0, NICENESS - os.nice(0)))
    os.environ["JAX_PLATFORMS"] = "cpu"
    from footfall.train.entry import learning_libraries

    with suppress(UserError), learning_libraries():
        import footfall.train.api  # noqa: F401  (takes seconds, spent before there is anything to do)
    with suppress(EOFError, KeyboardInterrupt):
        while True:
            requests.send(export_checkpoint(*requests.recv()))


def export_checkpoint(run: Path, checkpoint: Path, out: Path) -> Exported:
    """Export a copy of a checkpoint, since the training may delete the checkpoint at any time."""
    from footfall.train.entry import learning_libraries

    copy = out.with_name(checkpoint.name)
    try:
        _link_or_copy(checkpoint, copy)
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


def _link_or_copy(file: Path, copy: Path) -> None:
    """Hard-link a file, or copy it to another file system."""
    copy.unlink(missing_ok=True)
    try:
        copy.hardlink_to(file)
    except OSError:
        shutil.copyfile(file, copy)
