"""Train, resume and export: what the command line calls."""

import math
import os
import time
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import jax
import numpy as np

from envs.velocity import VelocityEnv
from robots.description import Robot, load_robot
from robots.errors import UserError
from robots.versions import versions
from train import checkpoint
from train.config import load_preset
from train.display import Display
from train.export import export
from train.metrics import MetricsLog
from train.networks import make_networks
from train.ppo import TrainState, initial_state, make_iteration
from train.provenance import PACKAGES, git_revision
from train.run import Provenance, Run, create_run, open_run
from train.stop import StopRequest


@dataclass(frozen=True)
class TrainRequest:
    """What to train."""

    robot: str = "go1"
    preset: str = "cpu"
    seed: int = 0
    out: Path | None = None  # default: runs/<robot>-<preset>-<seed>-<time>
    total_steps: int | None = None  # instead of the preset's


def train(request: TrainRequest) -> Path:
    """Train a policy into a new run folder and export it; returns the folder.

    Raises:
        UserError: no such robot or preset, a folder in use, a full disk, or a training that diverged.
    """
    config = load_preset(request.preset)
    if request.total_steps is not None:
        config = replace(config, ppo=replace(config.ppo, total_steps=request.total_steps))
    robot = load_robot(request.robot)
    now = datetime.now(UTC)
    name = f"{robot.name}-{Path(request.preset).stem}-{request.seed}-{now:%Y%m%d-%H%M%S}"
    provenance = Provenance(
        robot=request.robot if robot.name == request.robot else str(robot.folder),
        seed=request.seed,
        preset=request.preset,
        trainer="brax",
        device=jax.devices()[0].device_kind,
        revision=git_revision(),
        created=now.isoformat(timespec="seconds"),
        versions=versions(PACKAGES),
    )
    run = create_run(request.out or Path("runs") / name, provenance, config)
    return _continue(run, robot)


def resume(folder: Path) -> Path:
    """Continue a run that was stopped or killed, from its last checkpoint; returns the folder.

    Raises:
        UserError: there is no such run, its robot changed, or a checkpoint is damaged.
    """
    run = open_run(folder)
    return _continue(run, load_robot(run.provenance.robot))


def export_run(folder: Path, out: Path | None = None) -> tuple[Path, float]:
    """Export a run's last checkpoint; returns the file and the worst difference of an action.

    Raises:
        UserError: there is no checkpoint, the parity check fails, or `out` cannot be written.
    """
    run = open_run(folder)
    newest = checkpoint.latest(run.checkpoints)
    if newest is None:
        raise UserError(f"{folder} has no checkpoint yet")
    parts = _assemble(run, load_robot(run.provenance.robot))
    shapes = jax.eval_shape(parts.first_state)
    state, observations = checkpoint.restore(newest, shapes)
    path = out or run.policy
    return path, _export(parts, state, observations, path)


@dataclass(frozen=True)
class _Parts:
    """What a run's configuration builds."""

    env: VelocityEnv
    networks: Any
    run: Run

    def first_state(self) -> TrainState:
        return initial_state(self.env, self.networks, self.run.config.ppo, self.run.provenance.seed)


def _assemble(run: Run, robot: Robot) -> _Parts:
    env = VelocityEnv(robot, run.config.env)
    return _Parts(env, make_networks(env.observation_sizes, env.action_size, run.config.ppo), run)


def _continue(run: Run, robot: Robot) -> Path:
    """Train a run to its end, from its last checkpoint if it has one."""
    _use_compilation_cache()
    ppo = run.config.ppo
    with Display(ppo.total_steps) as display:
        began = time.monotonic()
        display.say(f"training {robot.name} on {jax.devices()[0].device_kind}, into {run.folder}")
        parts = _assemble(run, robot)
        newest = checkpoint.latest(run.checkpoints)
        observations: Any = np.zeros(0)
        if newest is None:
            state = jax.jit(parts.first_state)()
        else:
            state, observations = checkpoint.restore(newest, jax.eval_shape(parts.first_state))
            state = jax.device_put(state)
            display.say(f"resuming from {newest.name}")
        iterate = jax.jit(make_iteration(parts.env, parts.networks, ppo), donate_argnums=0)
        compiled = iterate.lower(state).compile()
        display.say(f"ready after {time.monotonic() - began:.1f} s")
        state, observations = _iterate(run, compiled, state, observations, display)
        difference = _export(parts, state, observations, run.policy)
        display.say(
            f"exported {run.policy} after {time.monotonic() - began:.1f} s;"
            f" ONNX Runtime and the trainer differ by at most {difference:.1e}"
        )
    return run.folder


def _iterate(run: Run, compiled: Any, state: Any, observations: Any, display: Display) -> tuple[Any, Any]:
    """Run the remaining iterations; log each one while the next is computed.

    A first Ctrl-C or SIGTERM ends the training after the iteration at hand, with a checkpoint.
    """
    ppo = run.config.ppo
    done = int(state.iteration)
    log = MetricsLog(run.folder, done * ppo.steps_per_iteration)
    pending: dict[str, jax.Array] | None = None
    saved_at = shown_at = time.monotonic()
    with StopRequest() as stop:
        while done < ppo.iterations and not stop.requested:
            state, metrics, observations = compiled(state)
            for value in metrics.values():  # now, or the copy would queue behind the next iteration
                value.copy_to_host_async()
            if pending is not None:
                shown_at = _report(run, done, pending, shown_at, log, display)
            pending, done = metrics, done + 1
            if time.monotonic() - saved_at > run.config.checkpoint_interval_s:
                _check_finite(run, pending)
                checkpoint.save(run.checkpoints, done, state, observations)
                saved_at = time.monotonic()
        if pending is not None:
            _report(run, done, pending, shown_at, log, display)
            checkpoint.save(run.checkpoints, done, state, observations)
    log.close()
    if done < ppo.iterations:
        display.say(f"stopped; continue with: footfall train --resume {run.folder}")
        raise KeyboardInterrupt
    return state, observations


def _report(
    run: Run,
    iteration: int,
    pending: dict[str, jax.Array],
    shown_at: float,
    log: MetricsLog,
    display: Display,
) -> float:
    """Wait for an iteration's metrics, record and show them; returns when they were there."""
    metrics = {name: float(value) for name, value in jax.device_get(pending).items()}
    now = time.monotonic()
    size = run.config.ppo.steps_per_iteration
    rate = size / max(now - shown_at, 1e-9)
    log.write(iteration * size, metrics | {"speed/steps_per_s": rate})
    _check_finite(run, metrics)
    display.update(iteration * size, rate, metrics)
    return now


def _check_finite(run: Run, metrics: dict[str, Any]) -> None:
    if not math.isfinite(float(metrics["learning/total_loss"])):
        newest = checkpoint.latest(run.checkpoints)
        raise UserError(
            "training diverged: the loss is not finite;"
            f" the last good checkpoint is {newest if newest else 'none'}"
        )


def _export(parts: _Parts, state: Any, observations: Any, path: Path) -> float:
    policy, normalizer = jax.device_get((state.params.policy, state.normalizer))
    logged = np.asarray(jax.device_get(observations))
    try:
        return export(parts.networks, normalizer, policy, parts.env.contract, logged, path)
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from None


def _use_compilation_cache() -> None:
    """Compile once per machine: keep compiled functions where the user's caches are."""
    home = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    folder = os.environ.get("JAX_COMPILATION_CACHE_DIR", str(home / "footfall" / "jax"))
    jax.config.update("jax_compilation_cache_dir", folder)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 1.0)
