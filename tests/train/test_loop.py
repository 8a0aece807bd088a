"""The training loop and its messages, with a trainer that computes nothing."""

import errno
import io
import json
import os
import signal
import sys
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from typing import Any
from unittest.mock import Mock

import jax.numpy as jnp
import pytest
from rich.console import Console
from training_metrics import METRICS

from footfall.common.config import dump
from footfall.common.errors import UserError
from footfall.train import api, cluster
from footfall.train.loop import learn
from footfall.train.runs import checkpoint
from footfall.train.runs.display import Display
from footfall.train.runs.folder import Run
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
