"""Train, resume and export: what the command line calls."""

import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from rich.console import Console

from footfall.common.errors import UserError
from footfall.common.versions import versions
from footfall.robots.default import DEFAULT_ROBOT
from footfall.robots.description import Robot, load_robot
from footfall.train import cluster
from footfall.train.brax.devices import device_mesh
from footfall.train.brax.diagnosis import Diagnosis, replay_failure
from footfall.train.brax.parts import assemble
from footfall.train.compilation_cache import use_compilation_cache
from footfall.train.config import load_preset
from footfall.train.loop import learn
from footfall.train.runs import checkpoint
from footfall.train.runs.display import Display
from footfall.train.runs.failure import device_failures
from footfall.train.runs.folder import (
    Provenance,
    Run,
    TrainerName,
    create_run,
    locked,
    open_run,
    trained_robot,
)
from footfall.train.runs.provenance import PACKAGES, source_revision
from footfall.train.trainer import TRAINERS


@dataclass(frozen=True)
class TrainRequest:
    """What to train."""

    robot: str = DEFAULT_ROBOT
    preset: str = "cpu"
    seed: int = 0
    out: Path | None = None  # default: runs/<robot>-<preset>-<seed>-<time>
    total_steps: int | None = None  # instead of the preset's
    checkpoint_interval_s: float | None = None  # instead of the preset's
    trainer: TrainerName = "brax"


def train(request: TrainRequest) -> Path:
    """Train a policy into a new run folder and export it; returns the folder.

    Raises:
        UserError: no such robot or preset, a folder in use, a full disk, or a training that diverged.
    """
    return resume(begin(request))


def begin(request: TrainRequest) -> Path:
    """Make the run folder of a training that `resume` then starts; returns the folder.

    Of several processes the first makes it, the others wait.

    Raises:
        UserError: no such robot or preset, settings that do not fit the robot or the devices, a folder in
            use, or a request that does not suit a cluster.
    """
    if cluster.processes() > 1:
        _check_cluster(request)
    folder = request.out or Path()
    with cluster.all_or_none():
        if cluster.is_main_process():
            folder = _make_run(request)
    return folder


def _check_cluster(request: TrainRequest) -> None:
    if request.out is None:
        raise UserError("several processes must know their run folder: give each the same --out")
    if TRAINERS[request.trainer].devices is not None:
        raise UserError(f"--trainer {request.trainer} trains in one process: leave --coordinator out")


def _make_run(request: TrainRequest) -> Path:
    robot = load_robot(request.robot)
    config = load_preset(request.preset, robot)
    if request.total_steps is not None:
        config = replace(config, ppo=replace(config.ppo, total_steps=request.total_steps))
    if request.checkpoint_interval_s is not None:
        config = replace(config, checkpoint_interval_s=request.checkpoint_interval_s)
    kind = TRAINERS[request.trainer]
    trainer = kind.load()  # libraries that are missing are to be known before there is a folder
    now = datetime.now(UTC)
    name = f"{robot.name}-{Path(request.preset).stem}-{request.seed}-{now:%Y%m%d-%H%M%S}"
    provenance = Provenance(
        robot=request.robot if robot.name == request.robot else str(robot.folder),
        seed=request.seed,
        preset=request.preset,
        trainer=request.trainer,
        device=cluster.devices()[0].device_kind,
        revision=source_revision(),
        created=now.isoformat(timespec="seconds"),
        versions=versions((*PACKAGES, *kind.packages)),
        robot_digest=robot.digest,
    )
    run = Run(request.out or Path("runs") / name, provenance, config)
    use_compilation_cache()
    trainer.prefetch(run, robot)
    _ = assemble(run, robot).mirror  # tells whether the settings fit the robot, before there is a folder
    device_mesh(config.ppo, kind.devices)
    return create_run(run.folder, provenance, config).folder


def resume(folder: Path, display: Display | None = None) -> Path:
    """Continue a run that was stopped, killed or only begun, from its last checkpoint; returns the folder.

    `display` is told how it goes (default: the user, on the terminal).

    Raises:
        UserError: there is no such run, another process trains it, its robot changed, or a checkpoint is
            damaged.
    """
    with cluster.all_or_none():
        run = open_run(folder)
        robot = trained_robot(run.provenance)
        refusal = use_compilation_cache()
        TRAINERS[run.provenance.trainer].load().prefetch(run, robot)
        lock = locked(run) if cluster.is_main_process() else nullcontext()
    if display is None:
        console = None if cluster.is_main_process() else Console(quiet=True)
        display = Display(run.config.ppo.total_steps, console)
    with lock, display:
        if refusal:
            display.say(refusal)
        if _is_finished(run):
            display.say(f"{folder} is finished: its policy is {run.policy}")
        else:
            try:
                _train_to_the_end(run, robot, display)
            except KeyboardInterrupt:
                display.say(_how_far(run))
                raise
    return run.folder


def diagnose(folder: Path, say: Callable[[str], None]) -> Diagnosis:
    """Replay a failed training to the first thing that broke; `say` is told what is being done.

    Raises:
        UserError: there is no failed training in this folder, or it is another trainer's.
    """
    if refusal := use_compilation_cache():
        say(refusal)
    return replay_failure(folder, say)


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
    chosen = checkpoint_path or checkpoint.latest(run.checkpoints)
    if chosen is None:
        raise UserError(f"{folder} has no checkpoint yet")
    cluster.devices()  # that they cannot be had is one line
    kind = TRAINERS[run.provenance.trainer].load()
    with device_failures(run, kind.device_errors, verb="export"):
        trainer = kind(run, robot)
        trainer.restore(chosen)
        return path, trainer.export(path)


def _train_to_the_end(run: Run, robot: Robot, display: Display) -> None:
    """Train from the last checkpoint, if there is one, and export."""
    began = time.monotonic()
    name, devices = run.provenance.trainer, cluster.devices()
    kind, where = TRAINERS[name].load(), devices[0].device_kind
    display.say(f"training {robot.name} with {name} on {where}, into {run.folder}")
    for change in _changes(run.provenance, where):
        display.say(f"it began on {change}: the same statistics, not the same bits")
    if TRAINERS[name].devices == 1 and len(devices) > 1:
        display.say(f"{name} trains on the first of {len(devices)} devices: the others are idle")
    with device_failures(run, kind.device_errors):
        trainer = kind(run, robot)
        with cluster.all_or_none():
            newest = _newest_checkpoint(run)
            if newest is not None:
                display.say(f"resuming from {newest.name}")
                trainer.restore(newest)
            display.doing("compiling")
            trainer.prepare(display.say)
        display.say(f"ready after {time.monotonic() - began:.1f} s")
        learn(run, trainer, display)
        with cluster.all_or_none():
            difference = trainer.export(run.policy)
    display.say(
        f"exported {run.policy} after {time.monotonic() - began:.1f} s;"
        f" ONNX Runtime and the trainer differ by at most {difference:.1e}"
    )


def _changes(began: Provenance, device: str) -> list[str]:
    """What a run began on that is another one now."""
    changes = [began.device] if began.device != device else []
    revision = source_revision()
    if began.revision != revision:
        changes.append(f"source revision {began.revision}, now {revision}")
    return changes


def _how_far(run: Run) -> str:
    """What a stopped run has kept, and how to go on with it."""
    newest, ppo = checkpoint.latest(run.checkpoints), run.config.ppo
    steps = int(newest.stem) * ppo.steps_per_iteration if newest else 0
    return (
        f"stopped after {steps:,} of {ppo.iterations * ppo.steps_per_iteration:,} steps;"
        f" continue with: footfall train --resume {run.folder}"
    )


def _is_finished(run: Run) -> bool:
    """Whether there is nothing left to train and to export, as process 0 sees it."""
    newest = checkpoint.latest(run.checkpoints)
    done = newest is not None and int(newest.stem) >= run.config.ppo.iterations
    (finished,) = cluster.broadcast(done and run.policy.is_file())
    return bool(finished)


def _newest_checkpoint(run: Run) -> Path | None:
    """The newest checkpoint of process 0, or None: others may see another one, as shared disks lag.

    Raises:
        UserError: this process does not see it.
    """
    newest = checkpoint.latest(run.checkpoints)
    (iteration,) = cluster.broadcast(int(newest.stem) if newest else 0)
    if iteration == 0:
        return None
    chosen = checkpoint.path_of(run.checkpoints, iteration)
    if not chosen.is_file():
        raise UserError(f"process 0 resumes from {chosen}, which is not to be seen from here: try again")
    return chosen
