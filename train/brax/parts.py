"""What a run's configuration builds: environment, networks, and the function that trains them."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import jax
import numpy as np
from brax.training.agents.ppo.networks import PPONetworks
from jax.sharding import Mesh

from footfall.common.collector import collector_paused
from footfall.envs.symmetry import EnvironmentMirror, environment_mirror
from footfall.envs.velocity import VelocityEnv
from footfall.envs.workarounds.program_cache import load_or_compile, model_bytes
from footfall.robots.description import Robot
from footfall.train.brax.devices import compiler_options, place, shardings, worth_keeping
from footfall.train.brax.networks import make_networks
from footfall.train.brax.ppo import STATE_SPECS, TrainState, initial_state, make_iteration
from footfall.train.config import TrainConfig
from footfall.train.runs.folder import Run

Iteration = Callable[[TrainState], tuple[TrainState, dict[str, jax.Array], jax.Array]]


@dataclass(frozen=True)
class Parts:
    """The parts of one run."""

    env: VelocityEnv
    networks: PPONetworks
    run: Run

    @property
    def mirror(self) -> EnvironmentMirror | None:
        """Of observations and actions, where the run learns from mirror images.

        Raises:
            UserError: it does, and its robot is not symmetric.
        """
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

    @collector_paused()
    def prepare(
        self, mesh: Mesh, restored: TrainState | None, say: Callable[[str], None]
    ) -> tuple[TrainState, Iteration]:
        """The state to begin with and the compiled iteration, which takes the state's memory for its own.

        Args:
            mesh: the devices to train on.
            restored: a checkpoint's state, on the host; None begins from the seed.
            say: told what a user should know.
        """
        shapes = self.shapes
        where = shardings(STATE_SPECS, shapes, mesh)
        if restored is not None:
            return place(restored, where), self._compiled_iteration(mesh, shapes, where, say)
        first = jax.jit(self.first_state, out_shardings=where, compiler_options=compiler_options(mesh))
        seed = np.uint32(self.run.provenance.seed & 0xFFFFFFFF)  # as much of it as JAX's keys hold
        # Traced here, not beside: what `fewer_kernels` replaces, it replaces for every thread.
        traced = first.lower(seed)
        # Compiled side by side. Nothing may run on the devices meanwhile: XLA times its kernels there.
        with ThreadPoolExecutor(1) as beside:
            first_compiled = beside.submit(traced.compile)
            iteration = self._compiled_iteration(mesh, shapes, where, say)
        return first_compiled.result()(seed), iteration

    def _compiled_iteration(
        self, mesh: Mesh, shapes: TrainState, where: TrainState, say: Callable[[str], None]
    ) -> Iteration:
        def compile_it() -> jax.stages.Compiled:
            iterate = jax.jit(
                make_iteration(self.env, self.networks, self.run.config.ppo, mesh, self.mirror),
                donate_argnums=0,
                in_shardings=(where,),
                compiler_options=compiler_options(mesh),
            )
            return iterate.lower(shapes).compile()

        if not worth_keeping(mesh):
            return compile_it()
        return load_or_compile(compile_it, say, *made_from(self.env.robot, self.run.config))


def made_from(robot: Robot, config: TrainConfig) -> tuple[Any, ...]:
    """All that a compiled iteration depends on, but for source, libraries and devices."""
    return robot.digest, model_bytes(robot, config.env.timestep_s), config.ppo, config.env


@collector_paused()
def assemble(run: Run, robot: Robot) -> Parts:
    """Build the parts of a run.

    Raises:
        UserError: the configuration does not fit the robot.
    """
    env = VelocityEnv(robot, run.config.env)
    return Parts(env, make_networks(env.observation_sizes, env.action_size, run.config.ppo), run)
