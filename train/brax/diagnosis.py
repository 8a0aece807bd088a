"""Diagnosis of a failed training: a replay of the failed iteration, to its first bad value."""

import io
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import Mesh

from footfall.common.errors import UserError
from footfall.common.files import write_atomically
from footfall.robots.description import Robot
from footfall.train import cluster
from footfall.train.brax.devices import device_mesh
from footfall.train.brax.iteration import Iteration, iteration_keys
from footfall.train.brax.parts import Parts, assemble
from footfall.train.brax.ppo import Ppo
from footfall.train.brax.rollout import roll_out
from footfall.train.brax.state import TrainState
from footfall.train.runs import checkpoint
from footfall.train.runs.diagnosis import Diagnosis, differences
from footfall.train.runs.failure import (
    ENVIRONMENT,
    FOLDER,
    Failure,
    failure_of,
    non_finite_leaves,
    not_finite,
)
from footfall.train.runs.folder import Run
from footfall.train.stacked import floats

DIVERGED = "the simulation diverged"


class _Fault(NamedTuple):
    """The first bad value, with its step and environment if it is in the rollout."""

    finding: str
    step: int = -1
    environment: int = -1
    inputs: Any = None  # (State, observation, action) of that environment, before the step


def diagnose(failure: Failure, run: Run, robot: Robot, report: Callable[[str], None]) -> Diagnosis:
    """See `footfall.train.trainer.Trainer.diagnose`.

    Raises:
        UserError: a checkpoint is damaged, or the environment cannot be written.
    """
    folder, devices = run.folder / FOLDER, cluster.devices()
    # Each device draws its own noise: use the training's number of devices, if available.
    count = min(failure.devices or len(devices), len(devices))
    replay = _Replay(failure, assemble(run.config, robot), device_mesh(run.config.ppo, count))
    state_before, iterate = replay.state_before(checkpoint.latest(folder), report)
    reason, state_after = replay.failing_iteration(state_before, iterate)
    fault = replay.first_fault(jax.device_get(state_before), state_after)
    saved = None
    if fault.inputs is not None:
        saved = folder / ENVIRONMENT
        _save_environment(saved, fault)
    changes = differences(failure, devices[0].device_kind, count)
    return Diagnosis(failure, changes, reason, fault.finding, saved)


class _Replay:
    """The failed training's functions."""

    def __init__(self, failure: Failure, parts: Parts, mesh: Mesh) -> None:
        self._failure = failure
        self._parts = parts
        self._mesh = mesh
        self._ppo = failure.config.ppo

    def state_before(self, start: Path | None, report: Callable[[str], None]) -> tuple[TrainState, Iteration]:
        """The state before the failing iteration, and the program that failed."""
        seed = self._failure.provenance.seed
        begin = checkpoint.restore(start, self._parts.shapes)[0] if start else seed
        state, iterate = self._parts.prepare(self._mesh, begin, report)
        done, last = int(state.iteration), self._failure.iteration - 1
        which = f"iterations {done + 1} to {last + 1}" if done < last else f"iteration {last + 1}"
        report(f"replaying {which} from {start.name if start else 'the seed'}")
        for _ in range(done, last):
            state, _, _ = iterate(state)
        return state, iterate

    def failing_iteration(self, state: TrainState, iterate: Iteration) -> tuple[str | None, TrainState]:
        """Why the iteration fails, or None, and the state after it, on the host."""
        state_after, metrics, _ = iterate(jax.tree.map(jnp.copy, state))  # it donates its argument
        figures = floats(metrics)
        state_after = jax.device_get(state_after)
        broken = non_finite_leaves(state_after)
        reason = failure_of(figures, self._failure.config.diverged_limit)
        return reason or (not_finite(broken) if broken else None), state_after

    def first_fault(self, state: TrainState, state_after: TrainState) -> _Fault:
        """The first bad value: in the rollout, in the update, or in the state after them.

        Each training device's share is computed separately, on one device.
        """
        devices = self._mesh.size
        act = jax.jit(partial(roll_out, self._parts.env, self._parts.networks, self._ppo))
        update = jax.jit(Ppo(self._parts.networks, self._ppo, mirror=self._parts.mirror).update)
        rollouts = [self._roll_out(act, state, device, devices) for device in range(devices)]
        faults = [fault for fault, _ in rollouts if fault is not None]
        if faults:
            return min(faults, key=lambda fault: fault.step)
        for device, (_, rollout) in enumerate(rollouts):
            fault = self._fault_of_update(update, state, device, rollout)
            if fault is not None:
                return fault
        broken = non_finite_leaves(state_after)
        return _Fault(
            f"rollout and losses are finite; in the state after them {not_finite(broken)}"
            if broken
            else "nothing: computed step by step, every value of the iteration is finite"
        )

    def _roll_out(
        self, act: Callable, state: TrainState, device: int, devices: int
    ) -> tuple[_Fault | None, Any]:
        """One device's share of the rollout: its first fault, or else its transitions."""
        count = self._ppo.num_envs // devices
        first = device * count
        env, observation = jax.tree.map(lambda x: x[first : first + count], (state.env, state.observation))
        current, steps = state._replace(env=env, observation=observation), []
        _, keys, _ = iteration_keys(state, self._ppo, device)
        for index in range(self._ppo.num_steps_per_env):
            (env, observation), (transition, metrics) = act(current, keys[index : index + 1])
            fault = self._fault_of_step(index, first, current, observation, transition, metrics)
            if fault is not None:
                return fault, None
            steps.append(transition)
            current = current._replace(env=env, observation=observation)
        return None, (jax.tree.map(lambda *leaves: jnp.concatenate(leaves), *steps), current.observation)

    def _fault_of_update(
        self, update: Callable, state: TrainState, device: int, rollout: Any
    ) -> _Fault | None:
        _, _, key = iteration_keys(state, self._ppo, device)
        params, _, losses = update(state, *rollout, key)
        figures = {name: np.asarray(value) for name, value in losses.items()}
        broken = ~np.isfinite(np.stack(list(figures.values()))).all(axis=0)  # (epoch, mini-batch)
        if not broken.any():
            return None
        epoch, batch = np.argwhere(broken)[0]
        names = [name for name, value in figures.items() if not np.isfinite(value[epoch, batch])]
        finding = f"update, epoch {epoch + 1}, mini-batch {batch + 1}: {not_finite(names)}"
        return _Fault(f"the rollout is finite; {finding}{self._parameters_after(params)}")

    def _fault_of_step(
        self,
        index: int,
        first_environment: int,
        current: TrainState,
        observation: Any,
        transition: Any,
        metrics: dict[str, jax.Array],
    ) -> _Fault | None:
        """The fault of one control step of a device's environments; causes before consequences."""
        if self._too_many_diverge():
            broken = {DIVERGED: np.asarray(metrics["episode/diverged"][0]) > 0}
        else:
            quantities = {"action": transition.action[0], **{n: v[0] for n, v in metrics.items()}}
            quantities |= {"reward": transition.reward[0]}
            quantities |= {f"observation {name}": value for name, value in observation.items()}
            broken = {name: broken_rows(value) for name, value in quantities.items()}
        broken = {name: rows for name, rows in broken.items() if rows.any()}
        if not broken:
            return None
        quantity, rows = next(iter(broken.items()))
        row = int(np.argmax(rows))
        environment = first_environment + row
        inputs = jax.tree.map(lambda x: x[row], (current.env, current.observation, transition.action[0]))
        if quantity == DIVERGED:
            finding = f"{DIVERGED}; {self._after_step(*inputs)}"
        else:
            finding = f"{quantity} is not finite"
        return _Fault(
            f"environment {environment}, control step {index + 1} of {self._ppo.num_steps_per_env}: {finding}"
            f" ({rows.sum()} of {rows.size} environments in this step)",
            index,
            environment,
            inputs,
        )

    def _after_step(self, env_state: Any, _: Any, action: jax.Array) -> str:
        """The state that a diverging simulation steps to, before the reset replaces it."""
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
        return f"; parameters after the update: {not_finite(broken)}" if broken else ""

    def _too_many_diverge(self) -> bool:
        return "diverged simulation" in self._failure.reason


def broken_rows(values: jax.Array) -> np.ndarray:
    """Which environments have a NaN or an infinity, (environments,)."""
    flat = np.asarray(values).reshape((values.shape[0], -1))
    return ~np.isfinite(flat).all(axis=1)


def _save_environment(path: Path, fault: _Fault) -> None:
    """One environment as named arrays: `state.qpos`, `state.sample.friction`, `action`, and so on."""
    env_state, observation, action = jax.device_get(fault.inputs)
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
