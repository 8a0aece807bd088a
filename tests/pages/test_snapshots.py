"""Policies of a run, exported one at a time in a process beside the page."""

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from footfall.pages.snapshots import FINISHED, NEWEST, Exported, Snapshot, Snapshots, newest_checkpoint


class TestSnapshots:
    @pytest.fixture
    def run(self, tmp_path: Path) -> Path:
        (tmp_path / "run" / "checkpoints").mkdir(parents=True)
        (tmp_path / "out").mkdir()
        return tmp_path / "run"

    def write(self, path: Path, at_s: int) -> Path:
        path.write_text("x")
        os.utime(path, (at_s, at_s))
        return path

    def found(self, run: Path) -> tuple[Snapshots, SimpleNamespace]:
        """Snapshots with a fake exporter."""
        exporter = SimpleNamespace(calls=[], woken=0, answer=None)
        exporter.start = lambda *given: exporter.calls.append(given)
        exporter.poll = lambda: exporter.answer
        exporter.wake = lambda: setattr(exporter, "woken", exporter.woken + 1)
        return Snapshots(run, run.parent / "out", exporter), exporter  # type: ignore[arg-type]

    def test_a_checkpoint_is_exported_once_and_returned_when_ready(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        checkpoint = self.write(run / "checkpoints" / "00000012.ckpt", 100)
        out = run.parent / "out" / "00000012.onnx"
        assert snapshots.poll() is None
        assert exporter.calls == [(checkpoint, out)]
        assert snapshots.exporting == 12
        assert snapshots.poll() is None  # not yet
        exporter.answer = Exported(out)
        assert snapshots.poll() == Snapshot(out, 12)
        assert snapshots.exporting is None
        assert snapshots.poll() is None
        assert len(exporter.calls) == 1

    def test_a_problem_is_reported_and_its_checkpoint_is_not_tried_again(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        self.write(run / "checkpoints" / "00000012.ckpt", 100)
        snapshots.poll()
        exporter.answer = Exported(None, "it is damaged")
        assert snapshots.poll() is None
        assert snapshots.problem == "it is damaged"
        assert snapshots.poll() is None
        assert len(exporter.calls) == 1
        done = self.write(run / FINISHED, 200)
        assert snapshots.poll() == Snapshot(done, 12)
        assert snapshots.problem == ""

    def test_the_newest_checkpoint_is_the_file_written_last(self, run: Path) -> None:
        snapshots, _ = self.found(run)
        self.write(run / "checkpoints" / "00000012.ckpt", 100)
        done = self.write(run / FINISHED, 200)
        assert snapshots.poll() == Snapshot(done, 12)
        later = self.write(run / "checkpoints" / "00000013.ckpt", 300)
        assert snapshots.poll() is None
        assert snapshots.exporting == 13
        assert newest_checkpoint(run) == later
        self.write(run / "checkpoints" / "00000009.ckpt", 400)  # the number in the name does not count
        self.write(run / "checkpoints" / "99999999.ckpt", 500)
        self.write(run / "checkpoints" / "100000000.ckpt", 50)
        assert newest_checkpoint(run) == run / "checkpoints" / "100000000.ckpt"
        assert newest_checkpoint(run.parent) is None

    def test_an_outdated_export_is_repeated(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        self.write(run / "checkpoints" / "00000012.ckpt", 100)
        exported = self.write(run.parent / "out" / "00000012.onnx", 99)
        assert snapshots.poll() is None
        assert len(exporter.calls) == 1
        other, exporter = self.found(run)
        self.write(exported, 100)
        assert other.poll() == Snapshot(exported, 12)
        assert exporter.calls == []

    def test_names_begin_with_the_newest_and_a_choice_is_found_by_name(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        assert snapshots.names() == [NEWEST]
        kept = self.write(run / "checkpoints" / "00001200.ckpt", 100)
        self.write(run / "checkpoints" / "00000090.ckpt", 100)
        self.write(run.parent / "out" / "00000090.onnx", 100)
        dropped = self.write(run.parent / "out" / "00000007.onnx", 100)
        done = self.write(run / FINISHED, 200)
        names = [NEWEST, FINISHED, "iteration 1,200", "iteration 90", "iteration 7"]
        assert snapshots.names() == names
        snapshots.chosen = "iteration 7"
        assert snapshots.poll() == Snapshot(dropped, 7)
        snapshots.chosen = FINISHED
        assert snapshots.poll() == Snapshot(done, 1200)
        snapshots.chosen = "iteration 1,200"
        assert snapshots.poll() is None
        assert exporter.calls == [(kept, run.parent / "out" / "00001200.onnx")]
        snapshots.chosen = "iteration 5"
        exporter.answer = Exported(None)
        assert snapshots.poll() is None
