"""What a run's configuration builds: environment, networks, and the function that trains them."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np
from brax.training.agents.ppo.networks import PPONetworks
from jax.sharding import Mesh

from footfall.common.collector import collector_paused
from footfall.common.errors import UserError
from footfall.envs.symmetry import EnvironmentMirror, environment_mirror
from footfall.envs.velocity import VelocityEnv
from footfall.envs.workarounds.kept_program import kept, model_bytes
from footfall.robots.description import Robot
from footfall.train.brax.devices import compiler_options, in_a_row, place, shardings, worth_keeping
from footfall.train.brax.networks import make_networks
from footfall.train.brax.ppo import STATE_SPECS, TrainState, initial_state, make_iteration
from footfall.train.config import TrainConfig
from footfall.train.runs import checkpoint
from footfall.train.runs.folder import Run

Iteration = Callable[[TrainState], tuple[TrainState, dict[str, Any], Any]]


@dataclass(frozen=True)
class Parts:
    """The parts of one run."""

    env: VelocityEnv
    networks: PPONetworks
    run: Run
    mesh: Mesh  # the devices it trains on

    @property
    def mirror(self) -> EnvironmentMirror | None:
        if not self.run.config.ppo.symmetry:
            return None
        return environment_mirror(self.env.robot, self.env.config, self.env.contract)

    @property
    def shapes(self) -> TrainState:
        """Shape and type of everything in a training's state."""
        return jax.eval_shape(self.first_state, np.uint32(0))

    def first_state(self, seed: jax.Array | np.uint32) -> TrainState:
        """The state before the first iteration; the seed is an argument, so that all have one program."""
        return initial_state(self.env, self.networks, self.run.config.ppo, seed)

    def iteration(self) -> Iteration:
        return make_iteration(self.env, self.networks, self.run.config.ppo, self.mesh, self.mirror)

    @collector_paused()
    def prepare(self, start: Path | None) -> tuple[TrainState, Any, Iteration]:
        """Everything that a training begins with; what has to be compiled is compiled side by side.

        Args:
            start: the checkpoint to continue from, or None.

        Returns:
            The state, observations that the actor saw before it, and the compiled iteration, which takes
            the state's memory for its own.

        Raises:
            UserError: the checkpoint is damaged or of another configuration.
        """
        shapes = self.shapes
        where = shardings(STATE_SPECS, shapes, self.mesh)
        if start is not None:
            state, observations = checkpoint.restore(start, shapes)
            return place(state, where), observations, self._compiled_iteration(shapes, where)
        first = jax.jit(self.first_state, out_shardings=where, compiler_options=compiler_options(self.mesh))
        seed = np.uint32(self.run.provenance.seed & 0xFFFFFFFF)  # as much of it as JAX's keys hold
        # Traced here, not beside: what `fewer_kernels` replaces, it replaces for every thread.
        traced = first.lower(seed)
        # Nothing may run on the devices meanwhile: XLA times its choices of kernels there.
        with ThreadPoolExecutor(1) as beside:
            first_compiled = beside.submit(traced.compile)
            compiled = self._compiled_iteration(shapes, where)
        return first_compiled.result()(seed), np.zeros(0), compiled

    def _compiled_iteration(self, shapes: TrainState, where: TrainState) -> Iteration:
        def compile_it() -> jax.stages.Compiled:
            options = compiler_options(self.mesh)
            iterate = jax.jit(
                self.iteration(), donate_argnums=0, in_shardings=(where,), compiler_options=options
            )
            return iterate.lower(shapes).compile()

        if not worth_keeping(self.mesh):
            return compile_it()
        return kept(compile_it, *made_from(self.env.robot, self.run.config))


def made_from(robot: Robot, config: TrainConfig) -> tuple[Any, ...]:
    """All that a compiled iteration depends on, but for source, libraries and devices."""
    return robot.digest, model_bytes(robot, config.env.timestep_s), config.ppo, config.env


@collector_paused()
def assemble(run: Run, robot: Robot, devices: int | None = None) -> Parts:
    """Build the parts of a run, for the first few devices or all of them.

    Raises:
        UserError: the configuration does not fit the robot or the devices.
    """
    mesh, ppo = in_a_row(devices), run.config.ppo
    if ppo.environments % (ppo.minibatches * mesh.size):
        raise UserError(
            f"ppo.environments {ppo.environments} cannot be divided among {mesh.size} devices"
            f" and {ppo.minibatches} minibatches: give a multiple of {ppo.minibatches * mesh.size}"
        )
    env = VelocityEnv(robot, run.config.env)
    return Parts(env, make_networks(env.observation_sizes, env.action_size, ppo), run, mesh)
