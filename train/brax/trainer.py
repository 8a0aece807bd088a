"""A training with brax's PPO: each iteration is one compiled function, on all devices of all processes."""

from collections.abc import Callable
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from threading import Thread
from typing import Any, ClassVar

import jax
import numpy as np

from footfall.robots.description import Robot
from footfall.train import cluster
from footfall.train.actor import LOGGED_OBSERVATIONS
from footfall.train.brax.devices import device_mesh, place, shardings
from footfall.train.brax.iteration import Iteration
from footfall.train.brax.networks import ACTOR, Means, actor_means_function, trained_actor
from footfall.train.brax.parts import assemble
from footfall.train.brax.start import copied_networks
from footfall.train.brax.state import STATE_SPECS, TrainState
from footfall.train.config import TrainConfig
from footfall.train.runs import checkpoint
from footfall.train.runs.diagnosis import Diagnosis
from footfall.train.runs.failure import Failure, TrainingFailedError, non_finite_leaves, not_finite
from footfall.train.runs.folder import Run
from footfall.train.trainer import Metrics, Trainer


class BraxTrainer(Trainer):
    """See `footfall.train.trainer.Trainer`."""

    device_errors: ClassVar[tuple[type[Exception], ...]] = (jax.errors.JaxRuntimeError,)
    max_devices: ClassVar[int | None] = None
    can_diagnose: ClassVar[bool] = True
    can_start_from: ClassVar[bool] = True

    def __init__(self, run: Run, robot: Robot) -> None:
        self.iteration = 0
        self._run = run
        self._parts = assemble(run.config, robot)
        self._state: TrainState | None = None
        self._observations: jax.Array | np.ndarray = np.zeros(0)  # a sample of what the actor observed
        self._compiled: Iteration | None = None

    def restore(self, path: Path) -> None:
        """Take over a checkpoint's state."""
        self._state, self._observations = checkpoint.restore(path, self._parts.shapes)
        self.iteration = int(self._state.iteration)

    def prepare(self, report: Callable[[str], None]) -> None:
        """Compile, and begin from the seed unless a state was restored."""
        mesh = device_mesh(self._run.config.ppo)
        start = self._run.provenance.seed if self._state is None else self._state
        self._state, self._compiled = self._parts.prepare(mesh, start, report)
        if cluster.is_main_process():
            example = jax.tree.map(
                lambda leaf: np.zeros(leaf.shape, leaf.dtype),
                (self._state.normalizer, self._state.params.policy),
            )
            Thread(target=self._prepare_export, args=(example,), name="prepare export").start()

    @cached_property
    def _means(self) -> Means:
        """The exported network's mean actions; first needed beside the training, where time costs nothing."""
        return actor_means_function(self._parts.exact_networks)

    def _prepare_export(self, example: tuple[Any, Any]) -> None:
        """Import and compile, beside the training, what the export needs for networks of these shapes."""
        with suppress(Exception):  # the export reports it
            from footfall.train.export import RANDOM_OBSERVATIONS

            size = self._parts.env.observation_sizes[ACTOR]
            logged = min(LOGGED_OBSERVATIONS, self._run.config.ppo.steps_per_iteration)
            self._means(*example, np.zeros((RANDOM_OBSERVATIONS + logged, size), np.float32))

    def start_from(self, path: Path) -> list[str]:
        """Take over networks and normaliser; see `footfall.train.trainer.Trainer`."""
        assert self._state is not None, "prepare first"
        fresh = jax.tree.map(np.asarray, cluster.gather((self._state.params, self._state.normalizer)))
        params, normalizer, notes = copied_networks(path, fresh[0], fresh[1], self._run.config.ppo)
        state_shardings = shardings(STATE_SPECS, device_mesh(self._run.config.ppo))
        self._state = self._state._replace(
            params=place(params, state_shardings.params),
            normalizer=place(normalizer, state_shardings.normalizer),
        )
        return list(notes)

    def iterate(self) -> Metrics:
        """Launch the next iteration, which the devices compute asynchronously."""
        assert self._state is not None, "prepare first"
        assert self._compiled is not None, "prepare first"
        self._state, metrics, self._observations = self._compiled(self._state)
        self.iteration += 1
        metrics.send()  # now: later, the copy would queue behind the next iteration
        return metrics

    def save(self) -> None:
        """Write a checkpoint of a finite state, in the main process."""
        state, observations = cluster.gather((self._state, self._observations))
        broken = non_finite_leaves(state)
        if broken:
            raise TrainingFailedError(self.iteration, not_finite(broken))
        if cluster.is_main_process():
            checkpoint.save(self._run.checkpoints, self.iteration, state, observations)

    def export(self, path: Path) -> float:
        """Write the policy, in the main process."""
        assert self._state is not None, "restore or prepare first"
        policy, normalizer, observations = cluster.gather(
            (self._state.params.policy, self._state.normalizer, self._observations)
        )
        if not cluster.is_main_process():
            return 0.0
        from footfall.train.export import export  # ONNX is needed at the end only

        actor = trained_actor(self._means, normalizer, policy)
        return export(actor, self._parts.env.contract, np.asarray(observations), path)

    @classmethod
    def metric_names(cls, config: TrainConfig, robot: Robot) -> list[str]:
        """Names of the metrics; traces one iteration, without compiling it."""
        parts = assemble(config, robot)
        _, metrics, _ = jax.eval_shape(parts.iteration(), parts.shapes)
        return sorted(metrics)

    @classmethod
    def diagnose(cls, failure: Failure, run: Run, robot: Robot, report: Callable[[str], None]) -> Diagnosis:
        """Replay a failed iteration."""
        from footfall.train.brax.diagnosis import diagnose  # needed after a failure only

        return diagnose(failure, run, robot, report)
