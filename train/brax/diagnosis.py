"""Diagnosis of a failed training: compute the failing iteration again, step by step; say what broke first."""

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh

from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.common.versions import versions
from footfall.train import cluster
from footfall.train.brax.devices import device_mesh
from footfall.train.brax.parts import Iteration, Parts, assemble
from footfall.train.brax.ppo import TrainState, iteration_keys, make_learning, make_rollout
from footfall.train.runs import checkpoint
from footfall.train.runs.failure import (
    ENVIRONMENT,
    FOLDER,
    REPORT,
    SOURCE,
    Failure,
    device_failures,
    failure_of,
    non_finite_leaves,
    not_finite,
    read_failure,
)
from footfall.train.runs.folder import Run, trained_robot
from footfall.train.runs.provenance import PACKAGES, source_revision

DIVERGED = "the simulation diverged"


@dataclass(frozen=True)
class Diagnosis:
    """What the replay of a failed training found."""

    failure: Failure
    differences: list[str]  # of what computed the replay; where there are any, it is approximate
    reason: str | None  # why the iteration failed in the replay; None: it did not
    finding: str  # the first thing that broke
    saved: Path | None  # the environment before the step in which it broke, if it was one's


class _Fault(NamedTuple):
    """The first thing that broke, and where in the rollout, if it was there."""

    finding: str
    step: int = -1
    environment: int = -1
    before: Any = None  # (State, observation, action) of that environment, before the step


def replay_failure(folder: Path, say: Callable[[str], None]) -> Diagnosis:
    """Replay a failed training from its last good checkpoint to the first thing that broke.

    On the machine and with the versions that failed, the replay computes the same bits; elsewhere it is
    approximate, and the failure may not show.

    Args:
        folder: the run folder.
        say: told what is being done.

    Raises:
        UserError: the run has not failed or is another trainer's, its robot has changed, or the device
            fails.
    """
    dump = folder / FOLDER
    if not (dump / REPORT).is_file():
        raise UserError(f"{folder} holds no failed training: there is no {FOLDER}/{REPORT}")
    failure = read_failure(dump / REPORT)
    if failure.provenance.trainer != "brax":
        raise UserError(
            f"{folder} was trained by {failure.provenance.trainer}: only brax runs can be replayed"
        )
    run = Run(folder, failure.provenance, failure.config)
    robot, there = trained_robot(failure.provenance), cluster.devices()
    with device_failures(run, verb="diagnose"):
        # Each device draws its own noise: where there are as many as there were, no more than those.
        count = min(failure.devices or len(there), len(there))
        replay = _Replay(failure, assemble(run, robot), device_mesh(run.config.ppo, count))
        before, iterate = replay.state_before(checkpoint.latest(dump), say)
        reason, after = replay.failing_iteration(before, iterate)
        fault = replay.first_fault(jax.device_get(before), after)
    saved = None
    if fault.before is not None:
        saved = dump / ENVIRONMENT
        _save_environment(saved, fault)
    differing = differences(failure, there[0].device_kind, count)
    return Diagnosis(failure, differing, reason, fault.finding, saved)


def differences(failure: Failure, device: str, devices: int) -> list[str]:
    """What differs between a failed training and its replay: 'NAME then, now' of devices and packages."""
    then = {"device": failure.device, "device count": str(failure.devices or devices)} | failure.versions
    now = {"device": device, "device count": str(devices), SOURCE: source_revision()} | versions(PACKAGES)
    return [f"{name} {old}, now {now[name]}" for name, old in then.items() if now.get(name, old) != old]


class _Replay:
    """The failed training's functions."""

    def __init__(self, failure: Failure, parts: Parts, mesh: Mesh) -> None:
        self._failure = failure
        self._parts = parts
        self._mesh = mesh
        self._ppo = failure.config.ppo

    def state_before(self, start: Path | None, say: Callable[[str], None]) -> tuple[TrainState, Iteration]:
        """The state before the failing iteration, and the program that failed."""
        restored = checkpoint.restore(start, self._parts.shapes)[0] if start else None
        state, iterate = self._parts.prepare(self._mesh, restored, say)
        done, last = int(state.iteration), self._failure.iteration - 1
        which = f"iterations {done + 1} to {last + 1}" if done < last else f"iteration {last + 1}"
        say(f"replaying {which} from {start.name if start else 'the seed'}")
        for _ in range(done, last):
            state, _, _ = iterate(state)
        return state, iterate

    def failing_iteration(self, state: TrainState, iterate: Iteration) -> tuple[str | None, TrainState]:
        """Why the iteration fails, or None, and the state after it, on the host."""
        after, metrics, _ = iterate(jax.tree.map(jnp.copy, state))  # it takes its argument's memory
        figures = {name: float(value) for name, value in jax.device_get(metrics).items()}
        after = jax.device_get(after)
        broken = non_finite_leaves(after)
        reason = failure_of(figures, self._failure.config.diverged_limit)
        return reason or (not_finite(broken) if broken else None), after

    def first_fault(self, state: TrainState, after: TrainState) -> _Fault:
        """What breaks first: in the rollout, in the learning, or in the state that they leave.

        Where several devices trained, each one's share is computed by itself, on one of them.
        """
        devices = self._mesh.size
        roll_out = jax.jit(make_rollout(self._parts.env, self._parts.networks, self._ppo))
        learn = jax.jit(make_learning(self._parts.networks, self._ppo, mirror=self._parts.mirror))
        rollouts = [self._roll_out(roll_out, state, device, devices) for device in range(devices)]
        faults = [fault for fault, _ in rollouts if fault is not None]
        if faults:
            return min(faults, key=lambda fault: fault.step)
        for device, (_, rollout) in enumerate(rollouts):
            fault = self._fault_of_learning(learn, state, device, rollout)
            if fault is not None:
                return fault
        left = non_finite_leaves(after)
        return _Fault(
            f"rollout and losses are sound; in the state after them {not_finite(left)}"
            if left
            else "nothing: computed step by step, the iteration is sound"
        )

    def _roll_out(
        self, roll_out: Callable, state: TrainState, device: int, devices: int
    ) -> tuple[_Fault | None, Any]:
        """One device's share of the rollout, step by step to its first fault; else its transitions."""
        count = self._ppo.num_envs // devices
        first = device * count
        env, observation = jax.tree.map(lambda x: x[first : first + count], (state.env, state.observation))
        now, steps = state._replace(env=env, observation=observation), []
        _, keys, _ = iteration_keys(state, self._ppo, device)
        for index in range(self._ppo.num_steps_per_env):
            (env, observation), (transition, metrics) = roll_out(now, keys[index : index + 1])
            fault = self._fault_of_step(index, first, now, observation, transition, metrics)
            if fault is not None:
                return fault, None
            steps.append(transition)
            now = now._replace(env=env, observation=observation)
        return None, (jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *steps), now.observation)

    def _fault_of_learning(
        self, learn: Callable, state: TrainState, device: int, rollout: Any
    ) -> _Fault | None:
        _, _, key = iteration_keys(state, self._ppo, device)
        params, _, losses = learn(state, *rollout, key)
        figures = {name: np.asarray(value) for name, value in losses.items()}
        broken = ~np.isfinite(np.stack(list(figures.values()))).all(axis=0)  # (pass, minibatch)
        if not broken.any():
            return None
        at = tuple(np.argwhere(broken)[0])
        names = [name for name, value in figures.items() if not np.isfinite(value[at])]
        finding = f"learning, pass {at[0] + 1}, minibatch {at[1] + 1}: {not_finite(names)}"
        return _Fault(f"the rollout is sound; {finding}{self._parameters_after(params)}")

    def _fault_of_step(
        self,
        index: int,
        first_environment: int,
        now: TrainState,
        observation: Any,
        transition: Any,
        metrics: dict[str, jax.Array],
    ) -> _Fault | None:
        """The fault of one control step of a device's environments; first what leads to the rest."""
        if self._too_many_diverge():
            broken = {DIVERGED: np.asarray(metrics["episode/diverged"][0]) > 0}
        else:
            quantities = {"action": transition.action[0], **{n: v[0] for n, v in metrics.items()}}
            quantities |= {"reward": transition.reward[0]}
            quantities |= {f"observation {name}": value for name, value in observation.items()}
            broken = {name: _broken_rows(value) for name, value in quantities.items()}
        broken = {name: rows for name, rows in broken.items() if rows.any()}
        if not broken:
            return None
        first, rows = next(iter(broken.items()))
        row = int(np.argmax(rows))
        environment = first_environment + row
        one = jax.tree.map(lambda x: x[row], (now.env, now.observation, transition.action[0]))
        found = f"{first} is not finite" if first != DIVERGED else f"{first}; {self._after_step(*one)}"
        return _Fault(
            f"environment {environment}, control step {index + 1} of {self._ppo.num_steps_per_env}: {found}"
            f" ({rows.sum()} of {rows.size} environments in this step)",
            index,
            environment,
            one,
        )

    def _after_step(self, env_state: Any, _: Any, action: jax.Array) -> str:
        """What a step makes of an environment whose simulation diverges, before the reset hides it."""
        with jax.default_matmul_precision("highest"):
            stepped, _ = jax.jit(self._parts.env.step)(env_state, action)
        broken = non_finite_leaves(jax.device_get(stepped))
        if broken:
            return f"after it {not_finite(broken)}"
        fastest = float(jnp.max(jnp.abs(stepped.qvel)))
        limit = self._failure.config.env.speed_limit
        return f"after it the largest qvel is {fastest:.3g}, speed_limit is {limit:g}"

    def _parameters_after(self, params: Any) -> str:
        broken = non_finite_leaves(jax.device_get(params))
        return f"; parameters after learning: {not_finite(broken)}" if broken else ""

    def _too_many_diverge(self) -> bool:
        return "diverged simulation" in self._failure.reason


def _broken_rows(values: jax.Array) -> np.ndarray:
    """Which environments have a NaN or an infinity, (environments,)."""
    flat = np.asarray(values).reshape((values.shape[0], -1))
    return ~np.isfinite(flat).all(axis=1)


def _save_environment(path: Path, fault: _Fault) -> None:
    """One environment as named arrays: `state.qpos`, `state.sample.friction`, `action`, and so on."""
    env_state, observation, action = jax.device_get(fault.before)
    tree = {"environment": fault.environment, "action": action}
    tree |= {f"observation.{name}": value for name, value in observation.items()}
    for keys, leaf in jax.tree_util.tree_leaves_with_path(env_state):
        tree["state." + jax.tree_util.keystr(keys, simple=True, separator=".")] = leaf
    content = io.BytesIO()
    np.savez(content, **tree)
    try:
        write_atomically(path, content.getvalue())
    except OSError as error:
        raise UserError(f"cannot write {path}: {error.strerror}") from None
