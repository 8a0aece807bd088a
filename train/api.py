"""Train, resume and export: what the command line calls."""

import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console

from footfall.common.config import require_not_negative
from footfall.common.errors import UserError
from footfall.common.versions import versions
from footfall.robots.default import DEFAULT_ROBOT
from footfall.robots.description import Robot, load_robot
from footfall.train import cluster
from footfall.train.checks import check_devices, check_robot
from footfall.train.compilation_cache import use_compilation_cache
from footfall.train.config import TrainConfig, load_preset, with_settings
from footfall.train.origin import check_source, find_source
from footfall.train.progress import is_finished, newest_checkpoint, stopped_message
from footfall.train.runs import checkpoint
from footfall.train.runs.diagnosis import Diagnosis
from footfall.train.runs.display import Display
from footfall.train.runs.failure import FOLDER, REPORT, device_failures, read_failure
from footfall.train.runs.folder import (
    Provenance,
    Run,
    create_run,
    locked,
    open_run,
    trained_robot,
)
from footfall.train.runs.provenance import PACKAGES, imported_revision
from footfall.train.trainer import Trainer
from footfall.train.trainers import DEFAULT_TRAINER, find_trainer, prefetch


@dataclass(frozen=True)
class TrainRequest:
    """What to train. Raises ValueError if the seed is negative."""

    robot: str = DEFAULT_ROBOT
    preset: str = "cpu"
    seed: int = 0
    out: Path | None = None  # default: runs/<robot>-<preset>-<seed>-<time>
    total_steps: int | None = None  # instead of the preset's
    checkpoint_interval_s: float | None = None  # instead of the preset's
    trainer: str = DEFAULT_TRAINER  # or "rsl_rl", or MODULE:NAME of your own
    settings: Mapping[str, Any] = field(default_factory=dict)  # by dotted keys, instead of the preset's
    start_from: Path | None = None  # run folder or .onnx file with the initial networks

    def __post_init__(self) -> None:
        require_not_negative(self, "seed")


def train(request: TrainRequest) -> Path:
    """Train a policy into a new run folder and export it; returns the folder.

    Raises:
        UserError: no such robot or preset, a folder in use, a full disk, or a training that diverged.
    """
    return resume(begin(request))


def begin(request: TrainRequest) -> Path:
    """Make the run folder of a training that `resume` then starts; returns the folder.

    With several processes, the first makes the folder and the others wait.

    Raises:
        UserError: no such robot or preset, settings that do not fit the robot or the devices, a folder in
            use, or a request that does not suit a cluster.
    """
    folder = request.out or Path()
    with cluster.all_or_none():
        robot = load_robot(request.robot)
        config = _settings(request, robot)
        use_compilation_cache()
        prefetch(request.trainer, robot, config)  # waits in threads for the device
        find_trainer(request.trainer)  # imports its libraries while the device starts; the next line waits
        if cluster.processes() > 1:
            _check_cluster(request)
        if cluster.is_main_process():
            folder = _make_run(request, robot, config)
    return folder


def _settings(request: TrainRequest, robot: Robot) -> TrainConfig:
    """The preset's settings, changed by the request's settings."""
    config = with_settings(load_preset(request.preset, robot), dict(request.settings), "--set")
    if request.total_steps is not None:
        config = replace(config, ppo=replace(config.ppo, total_steps=request.total_steps))
    if request.checkpoint_interval_s is not None:
        config = replace(config, checkpoint_interval_s=request.checkpoint_interval_s)
    return config


def _check_cluster(request: TrainRequest) -> None:
    if request.out is None:
        raise UserError("several processes share one run folder: give each the same --out")
    if find_trainer(request.trainer).max_devices is not None:
        raise UserError(f"--trainer {request.trainer} trains in one process: leave --coordinator out")


def _make_run(request: TrainRequest, robot: Robot, config: TrainConfig) -> Path:
    trainer = find_trainer(request.trainer)
    source = None
    if request.start_from is not None:
        if not trainer.can_start_from:
            raise UserError(f"--trainer {request.trainer} cannot start from other networks: leave --from out")
        source = find_source(request.start_from, request.trainer)
    now = datetime.now(UTC)
    name = f"{robot.name}-{Path(request.preset).stem}-{request.seed}-{now:%Y%m%d-%H%M%S}"
    provenance = Provenance(
        robot=request.robot if robot.name == request.robot else str(robot.folder),
        seed=request.seed,
        preset=request.preset,
        trainer=request.trainer,
        device=cluster.devices()[0].device_kind,
        revision=imported_revision(),
        created=now.isoformat(timespec="seconds"),
        versions=versions((*PACKAGES, *trainer.packages)),
        robot_digest=robot.digest,
    )
    run = Run(request.out or Path("runs") / name, provenance, config)
    contract = check_robot(config, robot, request.preset)
    if source is not None:
        origin = replace(source.origin, changed=tuple(check_source(source, contract, config.ppo)))
        provenance = replace(provenance, started_from=origin)
    check_devices(config.ppo, len(cluster.devices()[: trainer.max_devices]))
    return create_run(run.folder, provenance, config).folder


def resume(folder: Path, display: Display | None = None) -> Path:
    """Train a run from its last checkpoint, or from its start if there is none; returns the folder.

    Args:
        folder: the run folder.
        display: shows the progress (default: on the terminal).

    Raises:
        UserError: there is no such run, another process trains it, its robot changed, or a checkpoint is
            damaged.
    """
    with cluster.all_or_none():
        run = open_run(folder)
        robot = trained_robot(run.provenance)
        refusal = use_compilation_cache()
        prefetch(run.provenance.trainer, robot, run.config)
        lock = locked(run) if cluster.is_main_process() else nullcontext()
    if display is None:
        console = None if cluster.is_main_process() else Console(quiet=True)
        display = Display(run.config.ppo.total_steps, console)
    with lock, display:
        if refusal:
            display.report(refusal)
        if is_finished(run):
            display.report(f"{folder} is finished: its policy is {run.policy}")
        else:
            try:
                _train_to_the_end(run, robot, display)
            except KeyboardInterrupt:
                display.report(stopped_message(run))
                raise
    return run.folder


def diagnose(folder: Path, report: Callable[[str], None]) -> Diagnosis:
    """Replay a failed training from its last good checkpoint to the first value that is not finite.

    On the machine and with the versions that failed, the replay computes the same bits. Elsewhere it is
    approximate, and the failure may not show.

    Args:
        folder: the run folder.
        report: shows one line to the user.

    Raises:
        UserError: the run has not failed, its trainer cannot replay it, its robot has changed, or the device
            fails.
    """
    file = folder / FOLDER / REPORT
    if not file.is_file():
        raise UserError(f"{folder} holds no failed training: there is no {FOLDER}/{REPORT}")
    failure = read_failure(file)
    trainer = find_trainer(failure.provenance.trainer)
    if not trainer.can_diagnose:
        raise UserError(
            f"{folder} was trained by {failure.provenance.trainer}, whose runs cannot be replayed"
        )
    if refusal := use_compilation_cache():
        report(refusal)
    run = Run(folder, failure.provenance, failure.config)
    robot = trained_robot(failure.provenance)
    cluster.devices()  # reports in one line that there is no device
    with device_failures(run, trainer.device_errors, verb="diagnose"):
        return trainer.diagnose(failure, run, robot, report)


def export_run(
    folder: Path, out: Path | None = None, checkpoint_path: Path | None = None
) -> tuple[Path, float]:
    """Export a run's last checkpoint, or a given one; returns the file and the worst difference of an action.

    Raises:
        UserError: there is no checkpoint, the robot changed, the parity check fails, `out` cannot be
            written, or the device fails.
    """
    run = open_run(folder)
    robot, path = trained_robot(run.provenance), out or run.policy
    source = checkpoint_path or checkpoint.latest(run.checkpoints)
    if source is None:
        raise UserError(f"{folder} has no checkpoint yet")
    cluster.devices()  # reports in one line that there is no device
    trainer_class = find_trainer(run.provenance.trainer)
    with device_failures(run, trainer_class.device_errors, verb="export"):
        trainer = trainer_class(run, robot)
        trainer.restore(source)
        return path, trainer.export(path)


def _train_to_the_end(run: Run, robot: Robot, display: Display) -> None:
    """Train from the last checkpoint, if there is one, and export."""
    from footfall.train.loop import learn  # imports TensorBoard, while compiled programs are read

    start_s = time.monotonic()
    name, devices = run.provenance.trainer, cluster.devices()
    trainer_class, device = find_trainer(name), devices[0].device_kind
    display.report(f"training {robot.name} with {name} on {device}, into {run.folder}")
    for change in _changes(run.provenance, device):
        display.report(f"the run began on {change}: results are statistically equal, not bit for bit")
    if len(devices[: trainer_class.max_devices]) < len(devices):
        display.report(
            f"{name} trains on {trainer_class.max_devices} of {len(devices)} devices: the others are idle"
        )
    with device_failures(run, trainer_class.device_errors):
        trainer = trainer_class(run, robot)
        with cluster.all_or_none():
            newest = newest_checkpoint(run)
            if newest is not None:
                display.report(f"resuming from {newest.name}")
                trainer.restore(newest)
            display.show_stage("compiling")
            trainer.prepare(display.report)
            if newest is None and run.start is not None:
                _start_from(run, trainer, display)
        display.report(f"ready after {time.monotonic() - start_s:.1f} s")
        learn(run, trainer, display)
        with cluster.all_or_none():
            difference = trainer.export(run.policy)
    display.report(
        f"exported {run.policy} after {time.monotonic() - start_s:.1f} s;"
        f" ONNX Runtime and the trainer differ by at most {difference:.1e}"
    )


def _start_from(run: Run, trainer: Trainer, display: Display) -> None:
    """Load the networks that this training starts from; show what is loaded and what changed."""
    origin, start = run.provenance.started_from, run.start
    assert origin is not None
    assert start is not None
    display.report(f"starting from {origin.file}")
    for line in trainer.start_from(start):
        display.report(line)
    if origin.changed:
        display.report(f"new since the networks were trained: {', '.join(origin.changed)}")


def _changes(provenance: Provenance, device: str) -> list[str]:
    """Device and source revision that a run began with, if they have changed."""
    changes = [provenance.device] if provenance.device != device else []
    revision = imported_revision()
    if provenance.revision != revision:
        changes.append(f"source revision {provenance.revision}, now {revision}")
    return changes
