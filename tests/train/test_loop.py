"""The training loop with a trainer that computes nothing; the display, the log of metrics, checkpoints."""

import errno
import io
import json
import math
import os
import signal
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import jax.numpy as jnp
import numpy as np
import pytest
from rich.console import Console
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from training_metrics import METRICS

from footfall.common.config import dump
from footfall.common.errors import CannotWriteError, UserError
from footfall.train import api, cluster
from footfall.train.loop import learn
from footfall.train.runs import checkpoint, display, journal
from footfall.train.runs.display import Display
from footfall.train.runs.folder import Run
from footfall.train.runs.metrics import MetricsLog
from footfall.train.runs.speed import Speed
from footfall.train.trainer import Trainer

pytestmark = pytest.mark.usefixtures("hangups_end_the_process")

ITERATIONS = 4
STEPS = 256  # of an iteration


class FakeTrainer(Trainer):
    """Counts its iterations; a device computes the metrics when they are read."""

    def __init__(self, run: Run, before_iteration: Callable[[int], None] = lambda _: None) -> None:
        self.run, self.before_iteration, self.iteration = run, before_iteration, 0
        self.calls: list[str] = []

    def iterate(self) -> dict[str, Any]:
        self.before_iteration(self.iteration + 1)
        self.iteration += 1
        self.calls.append(f"iterate {self.iteration}")
        return {name: jnp.float32(value) for name, value in METRICS.items()}

    def save(self) -> None:
        self.calls.append(f"save {self.iteration}")
        checkpoint.write(self.run.checkpoints, self.iteration, b"state")


@pytest.fixture
def run(run: Run) -> Run:
    """A run of four iterations with a checkpoint only at the end."""
    ppo = replace(run.config.ppo, total_steps=ITERATIONS * STEPS)
    config = replace(run.config, ppo=ppo, checkpoint_interval_s=1e6)
    (run.folder / "config.yaml").write_text(dump(config))
    return replace(run, config=config)


def quiet() -> Display:
    return Display(ITERATIONS * STEPS, Console(file=io.StringIO()))


def logged(run: Run) -> list[dict[str, float]]:
    return [json.loads(line) for line in (run.folder / "metrics.jsonl").read_text().splitlines()]


def test_the_loop_logs_each_iteration_during_the_next_one_and_saves_the_last(run: Run) -> None:
    lines: list[int] = []
    trainer = FakeTrainer(run, lambda _: lines.append(len(logged(run))))
    learn(run, trainer, quiet())
    assert trainer.calls == ["iterate 1", "iterate 2", "iterate 3", "iterate 4", "save 4"]
    assert [line["step"] for line in logged(run)] == [STEPS * k for k in range(1, ITERATIONS + 1)]
    assert all(iteration - 2 <= count < iteration for iteration, count in enumerate(lines, 1))
    assert len(lines) == ITERATIONS


def test_a_checkpoint_is_saved_when_it_is_due_and_after_its_metrics(run: Run) -> None:
    often = replace(run, config=replace(run.config, checkpoint_interval_s=0.0))
    trainer = FakeTrainer(often)
    learn(often, trainer, quiet())
    assert trainer.calls == [f"{what} {k}" for k in range(1, ITERATIONS + 1) for what in ("iterate", "save")]


@pytest.mark.parametrize(
    ("during", "signals", "calls"),
    [
        (2, [signal.SIGTERM], ["iterate 1", "iterate 2", "save 2"]),
        (2, [signal.SIGHUP, signal.SIGHUP], ["iterate 1", "iterate 2", "save 2"]),  # a lost connection
        (2, [signal.SIGINT, signal.SIGINT], ["iterate 1"]),  # the second interrupts at once
        (ITERATIONS, [signal.SIGINT], [*(f"iterate {k}" for k in range(1, 5)), "save 4"]),  # it is complete
    ],
)
def test_a_signal_ends_a_training_after_the_iteration_with_a_checkpoint(
    run: Run, during: int, signals: list[int], calls: list[str]
) -> None:
    def stop(iteration: int) -> None:
        for number in signals if iteration == during else []:
            os.kill(os.getpid(), number)

    trainer = FakeTrainer(run, stop)
    with nullcontext() if during == ITERATIONS else pytest.raises(KeyboardInterrupt):
        learn(run, trainer, quiet())
    assert trainer.calls == calls
    assert len(logged(run)) == sum(call.startswith("iterate") for call in calls)


def test_a_training_under_nohup_outlives_its_terminal(run: Run) -> None:
    trainer = FakeTrainer(run, lambda _: os.kill(os.getpid(), signal.SIGHUP))
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    learn(run, trainer, quiet())
    assert trainer.calls[-1] == f"save {ITERATIONS}"


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EPIPE])
def test_a_failing_output_ends_no_training(run: Run, error: int, monkeypatch: pytest.MonkeyPatch) -> None:
    trainer = FakeTrainer(run)
    with open(os.devnull, "w") as nowhere:  # rich gives its descriptor away after EPIPE
        failing = Mock(io.StringIO, fileno=nowhere.fileno, write=Mock(side_effect=OSError(error, "failed")))
        monkeypatch.setattr(sys, "stdout", failing)
        learn(run, trainer, Display(ITERATIONS * STEPS, Console(file=failing)))
    assert trainer.calls[-1] == f"save {ITERATIONS}"


def test_other_processes_stop_and_save_with_the_main_one(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "is_main_process", lambda: False)
    decisions = iter([(0, 0), (0, 1), (1, 0), (0,)])  # stop, checkpoint due; at last: it is not saved
    monkeypatch.setattr(cluster, "broadcast", lambda *_: next(decisions))
    trainer = FakeTrainer(run)
    with pytest.raises(KeyboardInterrupt):
        learn(run, trainer, quiet())
    assert trainer.calls == ["iterate 1", "iterate 2", "save 2", "iterate 3", "save 3"]
    assert not (run.folder / "metrics.jsonl").exists()


@pytest.mark.parametrize("main", [True, False])
def test_metrics_are_logged_before_a_failure(run: Run, main: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing(FakeTrainer):
        def iterate(self) -> dict[str, Any]:
            metrics = super().iterate()
            return metrics | {"reward/alive": jnp.float32("nan")} if self.iteration == 2 else metrics

    monkeypatch.setattr(cluster, "is_main_process", lambda: main)
    trainer = Failing(run)
    with pytest.raises(UserError, match="iteration 2: reward/alive"):
        learn(run, trainer, quiet())
    assert trainer.calls == ["iterate 1", "iterate 2", "iterate 3"]
    if main:
        assert [line["step"] for line in logged(run)] == [STEPS, 2 * STEPS]
    assert (run.folder / "failure").exists() == main


def test_a_stopped_run_reports_its_progress_and_the_resume_command(
    run: Run, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(api, "_train_to_the_end", Mock(side_effect=KeyboardInterrupt))
    for kept, steps in ((None, "0"), (3, "768")):
        if kept:
            checkpoint.write(run.checkpoints, kept, b"state")
        with pytest.raises(KeyboardInterrupt):
            api.resume(run.folder)
        printed = capsys.readouterr().out
        assert f"{steps} of 1,024 steps" in printed
        assert f"footfall train --resume {run.folder}" in printed


def fill(disk: Path) -> Path:
    """Fill a disk."""
    filler, state = disk / "filler", os.statvfs(disk)
    filler.write_bytes(b"x" * (state.f_bavail * state.f_frsize))
    return filler


def test_a_failed_checkpoint_is_reported_once_and_retried(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    now, shown = SimpleNamespace(s=50.0), Mock()
    monkeypatch.setattr(journal, "time", SimpleNamespace(monotonic=lambda: now.s))
    often = replace(run, config=replace(run.config, checkpoint_interval_s=2.0))
    kept = journal.Journal(often, 2, shown)
    now.s += 2.1
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
    shown = Display(2000, Console(file=out, width=300))
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
