"""Train, resume and export: what the command line calls."""

import time
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import jax
import numpy as np
from rich.console import Console

from footfall.common.cache import compilation_cache
from footfall.common.errors import UserError
from footfall.common.versions import versions
from footfall.envs.workarounds.kept_program import read_ahead
from footfall.robots.description import Robot, load_robot
from footfall.train.brax import cluster
from footfall.train.brax.diagnosis import Diagnosis, replay_failure
from footfall.train.brax.networks import trained_actor
from footfall.train.brax.parts import Parts, assemble, made_from
from footfall.train.config import load_preset
from footfall.train.export import export
from footfall.train.rsl_rl.extra import rsl_rl_back_end
from footfall.train.runs import checkpoint
from footfall.train.runs.display import Display
from footfall.train.runs.failure import device_failures, failed, non_finite_leaves, not_finite
from footfall.train.runs.folder import Provenance, Run, Trainer, create_run, locked, open_run, trained_robot
from footfall.train.runs.journal import Follower, Journal
from footfall.train.runs.provenance import PACKAGES, TRAINER_PACKAGES, git_revision
from footfall.train.runs.stop import StopRequest


@dataclass(frozen=True)
class TrainRequest:
    """What to train."""

    robot: str = "go1"
    preset: str = "cpu"
    seed: int = 0
    out: Path | None = None  # default: runs/<robot>-<preset>-<seed>-<time>
    total_steps: int | None = None  # instead of the preset's
    checkpoint_interval_s: float | None = None  # instead of the preset's
    trainer: Trainer = "brax"


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
        if cluster.leads():
            folder = _make_run(request)
    return folder


def _check_cluster(request: TrainRequest) -> None:
    if request.out is None:
        raise UserError("several processes must know their run folder: give each the same --out")
    if request.trainer != "brax":
        raise UserError(f"--trainer {request.trainer} trains in one process: leave --coordinator out")


def _make_run(request: TrainRequest) -> Path:
    config = load_preset(request.preset)
    if request.total_steps is not None:
        config = replace(config, ppo=replace(config.ppo, total_steps=request.total_steps))
    if request.checkpoint_interval_s is not None:
        config = replace(config, checkpoint_interval_s=request.checkpoint_interval_s)
    robot = load_robot(request.robot)
    if request.trainer == "rsl_rl":
        rsl_rl_back_end()  # its lack is to be known before there is a folder
    now = datetime.now(UTC)
    name = f"{robot.name}-{Path(request.preset).stem}-{request.seed}-{now:%Y%m%d-%H%M%S}"
    provenance = Provenance(
        robot=request.robot if robot.name == request.robot else str(robot.folder),
        seed=request.seed,
        preset=request.preset,
        trainer=request.trainer,
        device=cluster.devices()[0].device_kind,
        revision=git_revision(),
        created=now.isoformat(timespec="seconds"),
        versions=versions((*PACKAGES, *TRAINER_PACKAGES[request.trainer])),
        robot_digest=robot.digest,
    )
    run = Run(request.out or Path("runs") / name, provenance, config)
    _use_compilation_cache()
    _read_ahead(run, robot)
    _check_settings(run, robot)
    return create_run(run.folder, provenance, config).folder


def _check_settings(run: Run, robot: Robot) -> None:
    """Build a run's parts, which tells whether its settings fit, before there is a folder.

    Raises:
        UserError: they do not.
    """
    devices = 1 if run.provenance.trainer == "rsl_rl" else None  # it trains on one
    _ = assemble(run, robot, devices).mirror


def _read_ahead(run: Run, robot: Robot) -> None:
    """Begin to look for the compiled iteration of a run that is about to be trained."""
    if run.provenance.trainer == "brax":
        read_ahead(*made_from(robot, run.config))


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
        _use_compilation_cache()
        _read_ahead(run, robot)
        lock = locked(run) if cluster.leads() else nullcontext()
    if display is None:
        display = Display(run.config.ppo.total_steps, None if cluster.leads() else Console(quiet=True))
    with lock:
        return _continue(run, robot, display)


def diagnose(folder: Path, say: Callable[[str], None]) -> Diagnosis:
    """Replay a failed training to the first thing that broke; `say` is told what is being done.

    Raises:
        UserError: there is no failed training in this folder, or it is another trainer's.
    """
    _use_compilation_cache()
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
    cluster.devices()
    if run.provenance.trainer == "rsl_rl":
        return path, rsl_rl_back_end().export_run(run, robot, chosen, path)
    with device_failures(run, verb="export"):
        parts = assemble(run, robot, devices=1)  # for its shapes, which do not depend on their number
        state, observations = checkpoint.restore(chosen, parts.shapes)
        return path, _export(parts, state, observations, path)


def _continue(run: Run, robot: Robot, display: Display) -> Path:
    """Train a run to its end, from its last checkpoint if it has one, and export it."""
    train_run = rsl_rl_back_end().train_run if run.provenance.trainer == "rsl_rl" else _train_with_brax
    with display:
        began = time.monotonic()
        who, where = run.provenance.trainer, cluster.devices()[0].device_kind
        display.say(f"training {robot.name} with {who} on {where}, into {run.folder}")
        if where != run.provenance.device:
            display.say(f"it began on {run.provenance.device}: the same statistics, not the same bits")
        with device_failures(run):
            difference = train_run(run, robot, display)
        display.say(
            f"exported {run.policy} after {time.monotonic() - began:.1f} s;"
            f" ONNX Runtime and the trainer differ by at most {difference:.1e}"
        )
    return run.folder


def _train_with_brax(run: Run, robot: Robot, display: Display) -> float:
    """Train and export; returns the worst difference of an action."""
    began = time.monotonic()
    parts = assemble(run, robot)
    with cluster.all_or_none():
        newest = _newest_of_the_leader(run)
        if newest is not None:
            display.say(f"resuming from {newest.name}")
        state, observations, compiled = parts.prepare(newest)
    display.say(f"ready after {time.monotonic() - began:.1f} s")
    state, observations = _iterate(run, compiled, state, observations, display)
    with cluster.all_or_none():
        return _export(parts, state, observations, run.policy)


def _newest_of_the_leader(run: Run) -> Path | None:
    """The newest checkpoint, or None. Other processes may see a newer or an older one: shared disks lag.

    Raises:
        UserError: this process does not see the leader's.
    """
    newest = checkpoint.latest(run.checkpoints)
    if cluster.processes() == 1:
        return newest
    iteration = cluster.the_leaders(int(newest.stem) if newest else 0)
    if iteration == 0:
        return None
    chosen = checkpoint.path_of(run.checkpoints, iteration)
    if not chosen.is_file():
        raise UserError(f"process 0 resumes from {chosen}, which is not to be seen from here: try again")
    return chosen


def _iterate(run: Run, compiled: Any, state: Any, observations: Any, display: Display) -> tuple[Any, Any]:
    """Run the remaining iterations; log each one while the next is computed.

    A first Ctrl-C or SIGTERM ends the training after the iteration at hand, with a checkpoint.
    """
    iterations = run.config.ppo.iterations
    done = int(state.iteration)
    with cluster.all_or_none():
        journal = Journal(run, done, display) if cluster.leads() else Follower(run)
    pending: dict[str, jax.Array] | None = None
    stopped = False
    with StopRequest() as stop:
        while done < iterations and not stopped:
            state, metrics, observations = compiled(state)
            for value in metrics.values():  # now, or the copy would queue behind the next iteration
                value.copy_to_host_async()
            if pending is not None:
                journal.report(done, _figures(pending))
            pending, done = metrics, done + 1
            stopped, due = cluster.as_the_leader_says(stop.requested, journal.checkpoint_due)
            if due:
                journal.report(done, _figures(pending))
                pending = None
                journal.keep(partial(_save, run, done, state, observations))
        if pending is not None:
            journal.report(done, _figures(pending))
        (unsaved,) = cluster.as_the_leader_says(not checkpoint.path_of(run.checkpoints, done).exists())
        if unsaved:
            with cluster.all_or_none():
                _save(run, done, state, observations)
    journal.close()
    if done < iterations:
        display.say(f"stopped; continue with: footfall train --resume {run.folder}")
        raise KeyboardInterrupt
    return state, observations


def _figures(metrics: dict[str, jax.Array]) -> dict[str, float]:
    """Metrics on the host, once they are computed."""
    return {name: float(value) for name, value in jax.device_get(metrics).items()}


def _save(run: Run, done: int, state: Any, observations: Any) -> None:
    """Write a checkpoint of a state that is worth it.

    Raises:
        CannotWriteError: the disk is full.
        UserError: the state is not finite.
    """
    state, observations = cluster.on_the_host((state, observations))
    broken = non_finite_leaves(state)
    if broken:
        raise failed(run, done, not_finite(broken))
    if cluster.leads():
        checkpoint.save(run.checkpoints, done, state, observations)


def _export(parts: Parts, state: Any, observations: Any, path: Path) -> float:
    policy, normalizer, logged = cluster.on_the_host((state.params.policy, state.normalizer, observations))
    if not cluster.leads():
        return 0.0
    actor = trained_actor(parts.networks, normalizer, policy)
    return export(actor, parts.env.contract, np.asarray(logged), path)


def _use_compilation_cache() -> None:
    """Compile once per machine: keep compiled functions where the user's caches are."""
    jax.config.update("jax_compilation_cache_dir", str(compilation_cache()))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 1.0)
