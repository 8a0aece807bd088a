"""Policies of a run, exported one at a time in a process beside the page."""

import errno
import multiprocessing
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from long_tests import long_test

from footfall.common.errors import UserError
from footfall.pages.snapshots import (
    FINISHED,
    NEWEST,
    Exported,
    Exporter,
    Snapshot,
    Snapshots,
    export_checkpoint,
    newest_checkpoint,
)
from footfall.robots.description import load_robot
from footfall.train.runs.folder import open_run


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
        """With an exporter that answers on request."""
        exporter = SimpleNamespace(calls=[], woken=0, answer=None)
        exporter.start = lambda *given: exporter.calls.append(given)
        exporter.poll = lambda: exporter.answer
        exporter.wake = lambda: setattr(exporter, "woken", exporter.woken + 1)
        return Snapshots(run, run.parent / "out", exporter), exporter  # type: ignore[arg-type]

    def test_the_exporter_is_prepared_before_the_first_checkpoint(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        assert snapshots.poll() is None
        assert (exporter.woken, exporter.calls) == (1, [])

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

    def test_an_export_of_a_deselected_checkpoint_is_not_shown(self, run: Path) -> None:
        snapshots, exporter = self.found(run)
        self.write(run / "checkpoints" / "00000012.ckpt", 100)
        assert snapshots.poll() is None
        done = self.write(run / FINISHED, 50)
        snapshots.chosen = FINISHED
        exporter.answer = Exported(run.parent / "out" / "00000012.onnx")
        assert snapshots.poll() == Snapshot(done, 12)

    def test_the_newest_is_the_file_written_last(self, run: Path) -> None:
        snapshots, _ = self.found(run)
        self.write(run / "checkpoints" / "00000012.ckpt", 100)
        done = self.write(run / FINISHED, 200)
        assert snapshots.poll() == Snapshot(done, 12)
        later = self.write(run / "checkpoints" / "00000013.ckpt", 300)
        assert snapshots.poll() is None
        assert snapshots.exporting == 13
        assert newest_checkpoint(run) == later
        self.write(run / "checkpoints" / "00000009.ckpt", 400)  # the number counts, not the time
        self.write(run / "checkpoints" / "99999999.ckpt", 500)
        self.write(run / "checkpoints" / "100000000.ckpt", 50)
        assert newest_checkpoint(run) == run / "checkpoints" / "100000000.ckpt"
        assert newest_checkpoint(run.parent) is None

    def test_an_export_older_than_its_checkpoint_is_repeated(self, run: Path) -> None:
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

    def test_an_exporter_that_dies_is_a_problem_and_another_is_started(self, run: Path) -> None:
        exporter, ended = Exporter(run), []
        ours, theirs = multiprocessing.Pipe()
        process = SimpleNamespace(
            terminate=lambda: ended.append("terminate"), join=lambda: ended.append("join")
        )
        exporter._connection, exporter._process = ours, process  # type: ignore[assignment]
        exporter.start(Path("a.ckpt"), Path("a.onnx"))
        assert theirs.recv() == (run, Path("a.ckpt"), Path("a.onnx"))
        assert exporter.poll() is None
        theirs.send(Exported(Path("a.onnx")))
        assert exporter.poll() == Exported(Path("a.onnx"))
        theirs.close()
        exporter.start(Path("b.ckpt"), Path("b.onnx"))  # there is no visitor
        assert exporter.poll() == Exported(None, "the process that exports it died")
        assert ended == ["terminate", "join"]
        assert ours.closed
        assert exporter._process is None

    def test_an_export_reports_its_own_problem(self, run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("footfall.train.entry.learning_libraries", nullcontext)
        checkpoint = self.write(run / "checkpoints" / "00000003.ckpt", 100)
        out = run.parent / "out" / "00000003.onnx"

        def fail(_: Path, __: Path, copy: Path) -> None:
            raise UserError(f"{copy} is\n damaged")

        monkeypatch.setattr("footfall.train.api.export_run", fail)
        assert export_checkpoint(run, checkpoint, out) == Exported(None, f"{checkpoint} is damaged")
        assert list(out.parent.iterdir()) == []
        assert export_checkpoint(run, run / "checkpoints" / "gone.ckpt", out) == Exported(None)
        given: list[Any] = []
        monkeypatch.setattr(
            "footfall.train.api.export_run", lambda *each: given.append(each) or ("made", 0.0)
        )
        assert export_checkpoint(run, checkpoint, out) == Exported("made")  # type: ignore[arg-type]
        assert given == [(run, out, out.with_name(checkpoint.name))]

    @pytest.fixture
    def snapshots(self, begun: Path, tmp_path: Path) -> Iterator[Snapshots]:
        found = Snapshots(begun, tmp_path)
        yield found
        found.close()

    def wait_for(self, snapshots: Snapshots) -> Snapshot | None:
        """The next snapshot, or None if the newest checkpoint cannot be used."""
        end = time.monotonic() + 240.0
        while time.monotonic() < end:
            if (snapshot := snapshots.poll()) is not None:
                return snapshot
            if snapshots.problem:
                return None
            time.sleep(0.05)
        pytest.fail("neither a snapshot nor a problem")

    @long_test
    def test_each_in_turn_except_damaged_ones(self, trained: Path, begun: Path, snapshots: Snapshots) -> None:
        (checkpoint,) = (trained / "checkpoints").iterdir()
        folder = begun / "checkpoints"
        folder.mkdir()
        shutil.copy(checkpoint, folder / "00000003.ckpt")
        before = sorted(begun.rglob("*"))
        assert snapshots.poll() is None
        assert snapshots.exporting == 3
        first = self.wait_for(snapshots)
        assert first is not None
        assert first.iteration == 3
        assert snapshots.exporting is None
        assert first.path.read_bytes() == (trained / "policy.onnx").read_bytes()
        assert sorted(begun.rglob("*")) == before  # the run folder is left as it was

        (folder / "00000004.ckpt").write_bytes(checkpoint.read_bytes()[:1000])
        assert self.wait_for(snapshots) is None
        assert "00000004.ckpt" in snapshots.problem
        assert snapshots.poll() is None

        snapshots.problem = ""
        dropped = Path(shutil.copy(checkpoint, folder / "00000005.ckpt"))
        assert snapshots.poll() is None
        dropped.unlink()  # as a training does that keeps few
        shutil.copy(checkpoint, folder / "00000006.ckpt")
        while (shown := self.wait_for(snapshots)) is not None and shown.iteration != 6:
            assert shown.iteration == 5  # it was taken before it was dropped

        (folder / "00000003.ckpt").unlink()
        shutil.copy(trained / "policy.onnx", begun)
        for chosen, iteration in (("iteration 3", 3), (FINISHED, 6), ("iteration 6", 6)):
            snapshots.chosen = chosen
            shown = snapshots.poll()  # at once: each was exported before
            assert shown is not None
            assert shown.iteration == iteration

    @pytest.mark.parametrize("linked", [True, False])
    def test_a_checkpoint_may_be_dropped_while_it_is_exported(
        self, begun: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, linked: bool
    ) -> None:
        """It is linked under another name, or copied on another file system."""

        def export_run(run: Path, out: Path, chosen: Path) -> tuple[Path, float]:
            checkpoint.unlink()
            out.write_bytes(chosen.read_bytes())
            return out, 0.0

        def elsewhere(*_: Any) -> None:
            raise OSError(errno.EXDEV, "another file system")

        monkeypatch.setattr("footfall.train.api.export_run", export_run)
        if not linked:
            monkeypatch.setattr(Path, "hardlink_to", elsewhere)
        checkpoint, out = begun / "00000003.ckpt", tmp_path / "00000003.onnx"
        (tmp_path / checkpoint.name).write_bytes(b"old")
        checkpoint.write_bytes(b"weights")
        assert export_checkpoint(begun, checkpoint, out) == Exported(out)
        assert out.read_bytes() == b"weights"
        assert list(tmp_path.glob("*.ckpt")) == []


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with a checkpoint and its exported policy, with constant weights instead of a training."""
    jax = pytest.importorskip("jax")
    from footfall.train import api
    from footfall.train.brax.parts import assemble
    from footfall.train.runs import checkpoint

    folder = api.begin(api.TrainRequest(preset="smoke", out=tmp_path_factory.mktemp("runs") / "alike"))
    run = open_run(folder)
    shapes = assemble(run.config, load_robot("go1")).shapes
    state = jax.tree.map(lambda leaf: np.full(leaf.shape, 0.01).astype(leaf.dtype), shapes)
    seen = np.zeros((4, *shapes.observation["state"].shape[1:]), np.float32)
    checkpoint.save(run.checkpoints, 3, state, seen)
    api.export_run(folder)
    return folder
