"""What a training shows and stores: the display, its speed, the log of metrics, checkpoints."""

import io
import json
import math
import os
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("tensorboard")

from rich.console import Console
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from training_metrics import METRICS

from footfall.common.errors import CannotWriteError, UserError
from footfall.train.runs import checkpoint, display, journal
from footfall.train.runs.folder import Run
from footfall.train.runs.metrics import MetricsLog
from footfall.train.runs.speed import Speed


def fill(disk: Path, leaving: int = 0) -> Path:
    """Fill a disk, except for this number of bytes."""
    filler, state = disk / "filler", os.statvfs(disk)
    filler.write_bytes(b"x" * (state.f_bavail * state.f_frsize - leaving))
    return filler


def test_a_failed_checkpoint_is_reported_once_and_retried(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    now, shown = SimpleNamespace(s=50.0), Mock()
    monkeypatch.setattr(journal, "time", SimpleNamespace(monotonic=lambda: now.s))
    kept = journal.Journal(run, 2, shown)
    now.s += 2.1  # the preset's interval is 2 s
    assert kept.checkpoint_due
    kept.save(Mock(side_effect=CannotWriteError("the disk is full")))
    assert not kept.checkpoint_due
    for error in (CannotWriteError("the disk is full"), None, None):
        kept.save(Mock(side_effect=error))
    failed, recovered = (call.args[0] for call in shown.report.call_args_list)
    assert ["the disk is full" in each for each in (failed, recovered)] == [True, False]


def test_a_line_of_the_display_has_progress_speed_and_quality(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a terminal a line is printed every five seconds, and at the end."""
    now, out = [100.0], io.StringIO()
    monkeypatch.setattr(display, "time", SimpleNamespace(monotonic=lambda: now[0]))
    shown = display.Display(2000, Console(file=out, width=300))
    counts = []
    for now[0], steps in ((100.0, 500), (104.9, 600), (105.1, 700), (105.2, 2048)):
        shown.update(steps, 250.0, METRICS)
        counts.append(out.getvalue().count("\n"))
    assert counts == [1, 1, 2, 3]
    first, _, last = out.getvalue().splitlines()
    facts = ("500 of 2,000 steps", "250 per s", "6 s", "reward 1.50", "2.0 s", "0.250 m/s", "0.500 rad/s")
    assert [fact for fact in facts if fact not in first] == []
    assert "2,000 of 2,000 steps" in last


def test_the_speed_is_of_the_last_five_seconds_and_not_raised_by_a_burst_of_reports() -> None:
    speed = Speed(0.0, 0)
    assert speed.after(2.0, 100) == 50.0
    assert speed.after(2.000001, 200) == pytest.approx(100.0, rel=1e-3)
    speed = Speed(0.0, 0)
    for second in range(1, 21):
        latest = speed.after(float(second), 100 * second if second <= 14 else 1400 + 7 * (second - 14))
    assert latest == 7.0
    assert speed.after(21.0, 1449 + 500) == (1449 + 500 - 1414) / 5.0


class TestMetricsLog:
    def test_tensorboard_reads_the_log_and_drops_repeated_steps(self, tmp_path: Path) -> None:
        for first, steps in ((0, (10, 20, 30)), (20, (30, 40))):  # killed after 30, resumed from 20
            log = MetricsLog(tmp_path, first)
            for step in steps:
                log.write(step, {"reward/total": step + first / 100, "reward/huge": -1e39})
            log.close()
        events = EventAccumulator(str(tmp_path / "events"))
        events.Reload()
        read = {event.step: event.value for event in events.Scalars("reward/total")}
        assert read == pytest.approx({10: 10.0, 20: 20.0, 30: 30.2, 40: 40.2})
        assert {event.value for event in events.Scalars("reward/huge")} == {-math.inf}
        lines = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
        assert [line["step"] for line in lines] == [10, 20, 30, 40]

    def test_a_resumed_log_keeps_its_earlier_rows(self, tmp_path: Path) -> None:
        path = tmp_path / "metrics.jsonl"
        path.write_text('{"step": 10}\n{"step": 20}\nhalf a li\n{"no": 1}\n{"step": 30}\n')
        MetricsLog(tmp_path, 20).close()
        assert path.read_text() == '{"step": 10}\n{"step": 20}\n'

    def test_a_record_that_does_not_fit_on_the_disk_leaves_no_part(self, disk: Path) -> None:
        log = MetricsLog(disk, 0)
        log.write(1, {"reward/total": 1.0})
        filler = fill(disk)
        with pytest.raises(CannotWriteError, match="No space left on device"):
            log.write(2, {f"reward/{k}": 1.0 for k in range(2000)})  # more than the rest of the last page
        filler.unlink()
        log.write(1000, {"reward/total": 2.0})
        log.close()
        lines = [json.loads(line) for line in (disk / "metrics.jsonl").read_text().splitlines()]
        assert lines == [{"step": 1, "reward/total": 1.0}, {"step": 1000, "reward/total": 2.0}]


class TestCheckpoint:
    def test_written_values_are_read_back(self, tmp_path: Path) -> None:
        written = {"a": np.arange(3.0, dtype=np.float32), "b": np.int32(4)}
        path = checkpoint.save(tmp_path / "c", 12, written, np.ones((2, 3), np.float32))
        assert path == tmp_path / "c" / "00000012.ckpt"
        state, seen = checkpoint.restore(path, {"a": jnp.zeros(3), "b": jnp.int32(0)})
        np.testing.assert_array_equal(state["a"], written["a"])
        assert (int(state["b"]), seen.shape) == (4, (2, 3))
        for other in (jnp.zeros(4), jnp.zeros(3, jnp.int32)):
            with pytest.raises(UserError):
                checkpoint.restore(path, {"a": other, "b": jnp.int32(0)})

    def test_three_are_kept_and_leftovers_of_a_killed_writer_are_deleted(self, tmp_path: Path) -> None:
        (tmp_path / ".00000001.ckpt.abc").touch()
        for iteration in (9, 10, 2, 100, 11):
            checkpoint.write(tmp_path, iteration, b"x")
        assert sorted(path.name for path in tmp_path.iterdir()) == [f"{k:08d}.ckpt" for k in (10, 11, 100)]
        assert checkpoint.latest(tmp_path) == tmp_path / "00000100.ckpt"
        assert checkpoint.latest(tmp_path / "none") is None

    def test_a_checkpoint_makes_room_for_itself_but_keeps_one(self, disk: Path) -> None:
        state = {"weights": np.zeros(2**16, np.float32)}  # a quarter of the disk
        for iteration in range(1, 4):
            checkpoint.save(disk, iteration, state, np.zeros(1))
        fill(disk)
        checkpoint.save(disk, 4, state, np.zeros(1))
        assert [p.name for p in sorted(disk.glob("*.ckpt"))] == ["00000003.ckpt", "00000004.ckpt"]
        (disk / "filler").unlink()
        fill(disk)
        with pytest.raises(CannotWriteError, match="00000004"):
            checkpoint.save(disk, 5, {"weights": np.zeros(2**17, np.float32)}, np.zeros(1))
        assert [p.name for p in sorted(disk.iterdir())] == ["00000004.ckpt", "filler"]
