"""Failures of a training: noticed, said in one line, and left so that the failing step can be replayed.

Iterations are deterministic, so a checkpoint and a count are enough to compute the failing iteration again
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
from footfall.train.runs.provenance import PACKAGES, source_revision
from footfall.train.trainer import TRAINERS

FOLDER = "failure"
REPORT = "failure.yaml"
SOURCE = "source revision"  # beside the packages' versions
ENVIRONMENT = "environment.npz"  # left by a replay
DEVICE_ERROR = "device_error.txt"
NAMED = 4  # names in a message, before "and so many more"
LONGEST_REASON = 200  # characters of a device's error that fit a line


@dataclass(frozen=True)
class Failure:
    """Which iteration failed, and what made it: the content of RUN/failure/failure.yaml.

    Beside it lies the checkpoint from which the iteration is computed again; none means from the seed.
    """

    iteration: int  # the first one is 1
    reason: str
    device: str
    versions: dict[str, str]
    provenance: Provenance
    config: TrainConfig
    devices: int = 0  # of all processes; 0: a report of before, which does not say


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
    """Why an iteration with these metrics is a failure, or None.

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
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return f"{', '.join(names[:NAMED])}{more} {'is' if len(names) == 1 else 'are'} not finite"


def non_finite_leaves(tree: Any) -> list[str]:
    """Paths of the arrays on the host that hold a NaN or an infinity."""
    return [
        jax.tree_util.keystr(path).lstrip(".")
        for path, leaf in jax.tree_util.tree_leaves_with_path(tree)
        if np.issubdtype(np.asarray(leaf).dtype, np.floating) and not np.all(np.isfinite(leaf))
    ]


def failed(run: Run, iteration: int, reason: str) -> UserError:
    """Leave what a replay of the failing iteration needs; returns the error to raise.

    Of several processes only the first leaves something.
    """
    if not cluster.is_main_process():
        return UserError(f"training failed in iteration {iteration}: {reason}; see process 0")
    newest = checkpoint.latest(run.checkpoints)
    failure = Failure(
        iteration=iteration,
        reason=reason,
        device=jax.devices()[0].device_kind,
        devices=len(jax.devices()),
        versions=versions(PACKAGES) | {SOURCE: source_revision()},
        provenance=run.provenance,
        config=run.config,
    )
    message = f"training failed in iteration {iteration}: {reason}; {_last_good(newest)}"
    try:
        _leave(run.folder / FOLDER, failure, newest)
    except OSError as error:
        return UserError(f"{message}; nothing to replay was left: {error.strerror}")
    if not TRAINERS[run.provenance.trainer].replayable:
        return UserError(f"{message}; all settings are in {run.folder / FOLDER / REPORT}")
    return UserError(f"{message}; find the cause with: footfall diagnose {run.folder}")


@contextmanager
def device_failures(
    run: Run, kinds: tuple[type[Exception], ...] = (jax.errors.JaxRuntimeError,), verb: str = "train --resume"
) -> Iterator[None]:
    """Turn a lost or exhausted accelerator into one line that says how to go on; the whole text is kept.

    Args:
        kinds: what its loss raises.
        verb: the command that goes on with the run.

    Raises:
        UserError: the device failed.
    """
    try:
        yield
    except kinds as error:
        text = str(error)
        if "Traceback (most recent call last)" in text:  # our own code, called from the device: a defect
            raise
        raise UserError(_device_failure(run, text, verb)) from None


def _device_failure(run: Run, text: str, verb: str) -> str:
    if jax.process_index() == 0:
        try:
            (run.folder / FOLDER).mkdir(exist_ok=True)
            write_atomically(run.folder / FOLDER / DEVICE_ERROR, text.encode())
        except OSError:
            pass  # the line below says what matters
    newest = checkpoint.latest(run.checkpoints)
    if "RESOURCE_EXHAUSTED" in text or "out of memory" in text.lower():
        return (
            f"the device is out of memory; {_last_good(newest)}; start a new run with a smaller"
            f" ppo.num_envs (it is {run.config.ppo.num_envs}), or go on with a device that has more:"
            f" footfall {verb} {run.folder}"
        )
    what = f"the device failed: {(text.splitlines() or [''])[0][:LONGEST_REASON]}"
    return f"{what}; {_last_good(newest)}; continue with: footfall {verb} {run.folder}"


def _last_good(newest: Path | None) -> str:
    return f"the last good checkpoint is {newest.name if newest else 'none'}"


def _leave(folder: Path, failure: Failure, newest: Path | None) -> None:
    """Make the failure's folder. The old report goes first, the new one comes last: it fits the rest."""
    folder.mkdir(exist_ok=True)
    (folder / REPORT).unlink(missing_ok=True)
    (folder / ENVIRONMENT).unlink(missing_ok=True)
    for old in folder.glob(f"*{checkpoint.SUFFIX}"):
        old.unlink()
    if newest is not None:
        _link(newest, folder / newest.name)
    write_atomically(folder / REPORT, dump(failure).encode())


def _link(source: Path, target: Path) -> None:
    """A second name for a file, which costs no room; a copy where there are no links."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
