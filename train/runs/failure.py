"""Failures of a training: detected, reported in one line, and kept so that the iteration can be replayed.

Iterations are deterministic: a checkpoint and the iteration's number are enough to compute it again
(`footfall.train.brax.diagnosis`). Nothing is recorded while a training goes well.
"""

import math
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np

from footfall.common.config import dump, read_yaml, structure
from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.common.versions import versions
from footfall.train import cluster
from footfall.train.config import TrainConfig
from footfall.train.old_names import with_current_names
from footfall.train.runs import checkpoint
from footfall.train.runs.folder import Provenance, Run
from footfall.train.runs.provenance import PACKAGES, imported_revision

FOLDER = "failure"
REPORT = "failure.yaml"
SOURCE = "source revision"  # key of the source revision among the packages' versions
ENVIRONMENT = "environment.npz"  # written by a replay
DEVICE_ERROR = "device_error.txt"
MAX_NAMES = 4  # names in a message; the others are counted
MAX_REASON_CHARS = 200  # characters of a device's error in a message


class TrainingFailedError(UserError):
    """An iteration's result is not finite, or too many simulations diverged."""

    def __init__(self, iteration: int, reason: str) -> None:
        super().__init__(f"training failed in iteration {iteration}: {reason}")
        self.iteration = iteration  # the first one is 1
        self.reason = reason


@dataclass(frozen=True)
class Failure:
    """The content of RUN/failure/failure.yaml: which iteration failed, and all that it depends on.

    The checkpoint to replay from lies beside it; without a checkpoint, the replay begins at the seed.
    """

    iteration: int  # the first one is 1
    reason: str
    device: str
    versions: dict[str, str]
    provenance: Provenance
    config: TrainConfig
    devices: int = 0  # of all processes; 0: unknown, in an older report


def read_failure(path: Path) -> Failure:
    """The report of a failed training.

    Raises:
        UserError: the file cannot be read, or something in it is wrong.
    """
    report = read_yaml(path)
    if isinstance(report, dict):
        report = report | {"config": with_current_names(report.get("config"))}
    return structure(report, Failure, str(path))


def failure_of(metrics: Mapping[str, float], diverged_limit: float) -> str | None:
    """Why an iteration with these metrics failed, or None if it did not.

    Args:
        diverged_limit: largest share of control steps whose simulation may diverge.
    """
    broken = [name for name, value in metrics.items() if not math.isfinite(value)]
    if broken:
        return not_finite(broken)
    share = metrics.get("episode/diverged", 0.0)
    if share > diverged_limit:
        return (
            f"{share:.2%} of the control steps ended in a diverged simulation"
            f" (config.yaml allows diverged_limit {diverged_limit:.2%})"
        )
    return None


def not_finite(names: list[str]) -> str:
    """'a, b and 3 more are not finite'."""
    more = f" and {len(names) - MAX_NAMES} more" if len(names) > MAX_NAMES else ""
    return f"{', '.join(names[:MAX_NAMES])}{more} {'is' if len(names) == 1 else 'are'} not finite"


def non_finite_leaves(tree: Any) -> list[str]:
    """Paths of the arrays on the host that hold a NaN or an infinity."""
    return [
        jax.tree_util.keystr(path).lstrip(".")
        for path, leaf in jax.tree_util.tree_leaves_with_path(tree)
        if np.issubdtype(np.asarray(leaf).dtype, np.floating) and not np.all(np.isfinite(leaf))
    ]


def record_failure(run: Run, failed: TrainingFailedError, can_diagnose: bool) -> UserError:
    """Write the report that a replay of the iteration needs; returns the error to raise.

    Only the main process writes.

    Args:
        run: the failed run.
        failed: its failure.
        can_diagnose: whether `footfall diagnose` can replay an iteration of the run's trainer.
    """
    if not cluster.is_main_process():
        return UserError(f"{failed}; see process 0")
    newest = checkpoint.latest(run.checkpoints)
    failure = Failure(
        iteration=failed.iteration,
        reason=failed.reason,
        device=jax.devices()[0].device_kind,
        devices=len(jax.devices()),
        versions=versions(PACKAGES) | {SOURCE: imported_revision()},
        provenance=run.provenance,
        config=run.config,
    )
    message = f"{failed}; {_last_good(newest)}"
    try:
        _write_report(run.folder / FOLDER, failure, newest)
    except OSError as error:
        return UserError(f"{message}; the failure could not be recorded: {error.strerror}")
    if not can_diagnose:
        return UserError(f"{message}; all settings are in {run.folder / FOLDER / REPORT}")
    return UserError(f"{message}; find the cause with: footfall diagnose {run.folder}")


@contextmanager
def device_failures(
    run: Run, errors: tuple[type[Exception], ...], verb: str = "train --resume"
) -> Iterator[None]:
    """Report a lost or exhausted accelerator in one line with the command to continue; keep the whole text.

    Args:
        run: the run that uses the device.
        errors: exceptions that the device raises (`Trainer.device_errors`).
        verb: the command that continues the run.

    Raises:
        UserError: the device failed.
    """
    try:
        yield
    except errors as error:
        text = str(error)
        if "Traceback (most recent call last)" in text:  # an error in footfall's code, called from the device
            raise
        raise UserError(_device_failure(run, text, verb)) from None


def _device_failure(run: Run, text: str, verb: str) -> str:
    if jax.process_index() == 0:
        try:
            (run.folder / FOLDER).mkdir(exist_ok=True)
            write_atomically(run.folder / FOLDER / DEVICE_ERROR, text.encode())
        except OSError:
            pass  # the message below is enough
    newest = checkpoint.latest(run.checkpoints)
    if "RESOURCE_EXHAUSTED" in text or "out of memory" in text.lower():
        return (
            f"the device is out of memory; {_last_good(newest)}; start a new run with a smaller"
            f" ppo.num_envs (it is {run.config.ppo.num_envs}), or continue on a device that has more:"
            f" footfall {verb} {run.folder}"
        )
    message = f"the device failed: {(text.splitlines() or [''])[0][:MAX_REASON_CHARS]}"
    return f"{message}; {_last_good(newest)}; continue with: footfall {verb} {run.folder}"


def _last_good(newest: Path | None) -> str:
    return f"the last good checkpoint is {newest.name if newest else 'none'}"


def _write_report(folder: Path, failure: Failure, newest: Path | None) -> None:
    """Write the failure's folder: an old report is deleted first, the new one is written last."""
    folder.mkdir(exist_ok=True)
    (folder / REPORT).unlink(missing_ok=True)
    (folder / ENVIRONMENT).unlink(missing_ok=True)
    for old in folder.glob(f"*{checkpoint.SUFFIX}"):
        old.unlink()
    if newest is not None:
        _link(newest, folder / newest.name)
    write_atomically(folder / REPORT, dump(failure).encode())


def _link(source: Path, target: Path) -> None:
    """A hard link, which needs no room on the disk; a copy where the file system has none."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
