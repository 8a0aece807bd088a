"""A run whose trainer is rsl_rl: from its last checkpoint to its end, with the same files as any run."""

import time
from pathlib import Path

import jax
import torch

from footfall.robots.description import Robot
from footfall.train.rsl_rl.trainer import RslRlTrainer
from footfall.train.runs import checkpoint
from footfall.train.runs.display import Display
from footfall.train.runs.failure import device_failures, failed, not_finite
from footfall.train.runs.folder import Run
from footfall.train.runs.journal import Journal
from footfall.train.runs.stop import StopRequest

DEVICE_ERRORS = (jax.errors.JaxRuntimeError, torch.OutOfMemoryError, torch.AcceleratorError)


def train_run(run: Run, robot: Robot, display: Display) -> float:
    """Train a run to its end, from its last checkpoint if it has one, and export it.

    Returns:
        The worst difference of an action between ONNX Runtime and the trainer's own network.

    Raises:
        UserError: a full disk, a damaged checkpoint, a failing device, or a training that diverged.
        KeyboardInterrupt: a user stopped it; its checkpoint is written.
    """
    began = time.monotonic()
    _say_what_is_idle(len(jax.devices()), display)
    with device_failures(run, DEVICE_ERRORS):
        trainer = RslRlTrainer(run, robot)
        newest = checkpoint.latest(run.checkpoints)
        if newest is not None:
            trainer.restore(newest)
            display.say(f"resuming from {newest.name}")
        display.say(f"ready after {time.monotonic() - began:.1f} s")
        _iterate(run, trainer, display)
        return trainer.export(run.policy)


def export_run(run: Run, robot: Robot, chosen: Path, path: Path) -> float:
    """Export one checkpoint; returns and raises as `train_run`."""
    with device_failures(run, DEVICE_ERRORS, verb="export"):
        trainer = RslRlTrainer(run, robot)
        trainer.restore(chosen)
        return trainer.export(path)


def _say_what_is_idle(devices: int, display: Display) -> None:
    if devices > 1:
        display.say(f"rsl_rl trains on the first of {devices} devices: the others are idle")


def _iterate(run: Run, trainer: RslRlTrainer, display: Display) -> None:
    """Run the remaining iterations; a first Ctrl-C or SIGTERM ends them early, with a checkpoint."""
    first, last = trainer.iteration, run.config.ppo.iterations
    journal = Journal(run, first, display)
    with StopRequest() as stop:
        while trainer.iteration < last and not stop.requested:
            metrics = _iteration(run, trainer)
            journal.report(trainer.iteration, metrics)
            if journal.checkpoint_due:
                journal.keep(trainer.save)
        if trainer.iteration > first:
            trainer.save()
    journal.close()
    if trainer.iteration < last:
        display.say(f"stopped; continue with: footfall train --resume {run.folder}")
        raise KeyboardInterrupt


def _iteration(run: Run, trainer: RslRlTrainer) -> dict[str, float]:
    """One iteration; returns its metrics.

    Raises:
        UserError: the networks are not finite.
    """
    try:
        return trainer.iterate()
    except RuntimeError:
        broken = trainer.broken()  # torch does not draw from a distribution that is not finite
        if not broken:
            raise
        raise failed(run, trainer.iteration + 1, not_finite(broken)) from None
