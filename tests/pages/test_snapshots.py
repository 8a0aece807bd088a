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

    def write(self, folder: Path, name: str, at_s: int) -> Path:
        (folder / name).write_text("x")
        os.utime(folder / name, (at_s, at_s))
        return folder / name

    def checkpoint(self, run: Path, number: str, at_s: int = 100) -> Path:
        return self.write(run / "checkpoints", f"{number}.ckpt", at_s)

    def found(self, run: Path) -> tuple[Snapshots, SimpleNamespace]:
        """Snapshots with a fake exporter."""
        exporter = SimpleNamespace(calls=[], answer=None, wake=lambda: None)
        exporter.start = lambda *given: exporter.calls.append(given)
        exporter.poll = lambda: exporter.answer
        return Snapshots(run, run.parent / "out", exporter), exporter  # type: ignore[arg-type]

    def test_a_checkpoint_is_exported_once_and_returned_when_ready(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        checkpoint, out = self.checkpoint(run, "00000012"), run.parent / "out" / "00000012.onnx"
        for _ in range(2):  # not yet
            assert (snapshots.poll(), snapshots.exporting) == (None, 12)
        exporter.answer = Exported(out)
        assert (snapshots.poll(), snapshots.exporting) == (Snapshot(out, 12), None)
        assert snapshots.poll() is None
        assert exporter.calls == [(checkpoint, out)]

    def test_a_problem_is_reported_and_its_checkpoint_is_not_tried_again(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        self.checkpoint(run, "00000012")
        snapshots.poll()
        exporter.answer = Exported(None, "it is damaged")
        for _ in range(2):
            assert (snapshots.poll(), snapshots.problem) == (None, "it is damaged")
        assert len(exporter.calls) == 1
        done = self.write(run, FINISHED, 200)
        assert (snapshots.poll(), snapshots.problem) == (Snapshot(done, 12), "")

    def test_the_highest_checkpoint_is_exported_if_newer_than_the_policy(self, run: Path) -> None:
        snapshots, _ = self.found(run)
        self.checkpoint(run, "00000012")
        done = self.write(run, FINISHED, 200)
        assert snapshots.poll() == Snapshot(done, 12)
        later = self.checkpoint(run, "00000013", 300)
        assert (snapshots.poll(), snapshots.exporting) == (None, 13)
        assert newest_checkpoint(run) == later
        self.checkpoint(run, "00000009", 400)
        self.checkpoint(run, "99999999", 500)
        highest = self.checkpoint(run, "100000000", 50)
        assert newest_checkpoint(run) == highest
        assert newest_checkpoint(run.parent) is None

    def test_an_outdated_export_is_repeated(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        self.checkpoint(run, "00000012")
        self.write(run.parent / "out", "00000012.onnx", 99)
        assert (snapshots.poll(), len(exporter.calls)) == (None, 1)
        other, exporter = self.found(run)
        exported = self.write(run.parent / "out", "00000012.onnx", 100)
        assert other.poll() == Snapshot(exported, 12)
        assert exporter.calls == []

    def test_names_begin_with_the_newest_and_a_choice_is_found_by_name(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        assert snapshots.names() == [NEWEST]
        kept = self.checkpoint(run, "00001200")
        self.checkpoint(run, "00000090")
        self.write(run.parent / "out", "00000090.onnx", 100)
        dropped = self.write(run.parent / "out", "00000007.onnx", 100)
        done = self.write(run, FINISHED, 200)
        assert snapshots.names() == [NEWEST, FINISHED, "iteration 1,200", "iteration 90", "iteration 7"]
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
