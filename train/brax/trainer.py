"""A training with brax's PPO: each iteration is one compiled function, on all devices of all processes."""

from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

import jax
import numpy as np

from footfall.robots.description import Robot
from footfall.train import cluster
from footfall.train.brax.devices import device_mesh
from footfall.train.brax.networks import trained_actor
from footfall.train.brax.parts import Iteration, assemble, prefetch_programs
from footfall.train.brax.ppo import TrainState
from footfall.train.export import export
from footfall.train.runs import checkpoint
from footfall.train.runs.failure import failed, non_finite_leaves, not_finite
from footfall.train.runs.folder import Run
from footfall.train.trainer import Metrics


class BraxTrainer:
    """See `footfall.train.trainer.Trainer`."""

    device_errors: ClassVar[tuple[type[Exception], ...]] = (jax.errors.JaxRuntimeError,)

    def __init__(self, run: Run, robot: Robot) -> None:
        self.iteration = 0
        self._run = run
        self._parts = assemble(run, robot)
        self._state: TrainState | None = None
        self._observations: jax.Array | np.ndarray = np.zeros(0)  # some that the actor saw
        self._compiled: Iteration | None = None

    @staticmethod
    def prefetch(run: Run, robot: Robot) -> None:
        """Begin to read the compiled programs of an earlier training, beside what comes next."""
        prefetch_programs(robot, run.config)

    def restore(self, path: Path) -> None:
        """Take over a checkpoint's state."""
        self._state, self._observations = checkpoint.restore(path, self._parts.shapes)
        self.iteration = int(self._state.iteration)

    def prepare(self, say: Callable[[str], None]) -> None:
        """Compile, and begin from the seed unless a state was restored."""
        mesh = device_mesh(self._run.config.ppo)
        self._state, self._compiled = self._parts.prepare(mesh, self._state, say)

    def iterate(self) -> Metrics:
        """Begin the next iteration, which the devices compute meanwhile."""
        assert self._state is not None, "prepare first"
        assert self._compiled is not None, "prepare first"
        self._state, metrics, self._observations = self._compiled(self._state)
        self.iteration += 1
        for value in metrics.values():  # now, or the copy would queue behind the next iteration
            value.copy_to_host_async()
        return metrics

    def save(self) -> None:
        """Write a checkpoint, if the state is worth it."""
        state, observations = cluster.gather((self._state, self._observations))
        broken = non_finite_leaves(state)
        if broken:
            raise failed(self._run, self.iteration, not_finite(broken))
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
        actor = trained_actor(self._parts.exact_networks, normalizer, policy)
        return export(actor, self._parts.env.contract, np.asarray(observations), path)
