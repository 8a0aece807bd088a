"""What a run's configuration builds: environment, networks, and the function that trains them."""

from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np
from brax.training.agents.ppo.networks import PPONetworks
from jax.sharding import Mesh

from footfall.common.collector import collector_paused
from footfall.envs.symmetry import EnvironmentMirror, environment_mirror
from footfall.envs.velocity import VelocityEnv
from footfall.envs.workarounds.program_cache import load_or_compile, model_bytes, prefetch
from footfall.robots.description import Robot
from footfall.train.brax.devices import compiler_options, place, shardings, worth_keeping
from footfall.train.brax.networks import make_networks
from footfall.train.brax.ppo import STATE_SPECS, TrainState, initial_state, make_iteration
from footfall.train.config import TrainConfig
from footfall.train.runs.folder import Run

PROGRAMS = ("first state", "iteration")  # of a training
Iteration = Callable[[TrainState], tuple[TrainState, dict[str, jax.Array], jax.Array]]


@dataclass(frozen=True)
class Parts:
    """The parts of one run."""

    env: VelocityEnv
    networks: PPONetworks
    run: Run

    @property
    def exact_networks(self) -> PPONetworks:
        """The networks in float32 throughout, as they are exported."""
        exact = replace(self.run.config.ppo, bfloat16=False)
        return make_networks(self.env.observation_sizes, self.env.action_size, exact)

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
        if self.env.engine.note:
            say(self.env.engine.note)
        where, options = shardings(STATE_SPECS, mesh), compiler_options(mesh)
        first_state = self.first_state  # held, or JAX would forget what it has traced
        seed = np.uint32(self.run.provenance.seed & 0xFFFFFFFF)  # as much of it as JAX's keys hold

        def first() -> jax.stages.Lowered:
            return jax.jit(first_state, out_shardings=where, compiler_options=options).lower(seed)

        def iteration() -> jax.stages.Lowered:
            iterate = make_iteration(self.env, self.networks, self.run.config.ppo, mesh, self.mirror)
            jitted = jax.jit(iterate, donate_argnums=0, in_shardings=(where,), compiler_options=options)
            return jitted.lower(self.shapes)

        said: list[str] = []

        def say_once(line: str) -> None:
            if line not in said:
                said.append(line)
                say(line)

        # Compiled side by side. Nothing may run on the devices meanwhile: XLA times its kernels there.
        with ThreadPoolExecutor(len(PROGRAMS)) as beside:
            begun = None
            if restored is None:
                begun = self._program("first state", first, mesh, beside, say_once)
            compiled = self._program("iteration", iteration, mesh, beside, say_once)
        state = place(restored, where) if begun is None else begun.result()(seed)
        return state, compiled.result()

    def _program(
        self,
        name: str,
        lower: Callable[[], jax.stages.Lowered],
        mesh: Mesh,
        beside: Executor,
        say: Callable[[str], None],
    ) -> Future[jax.stages.Compiled]:
        """One of `PROGRAMS`, as it was kept, or compiled `beside` once it has been traced."""
        if not worth_keeping(mesh):
            return beside.submit(lower().compile)
        return load_or_compile(lower, beside, say, name, *made_from(self.env.robot, self.run.config))


def prefetch_programs(robot: Robot, config: TrainConfig) -> None:
    """Begin to read what an earlier training compiled of the same robot and settings."""
    for name in PROGRAMS:
        prefetch(name, *made_from(robot, config))


def made_from(robot: Robot, config: TrainConfig) -> tuple[Any, ...]:
    """All that a training's programs depend on, but for source, libraries and devices."""
    return robot.digest, model_bytes(robot, config.env.timestep_s), config.ppo, config.env


@collector_paused()
def assemble(run: Run, robot: Robot) -> Parts:
    """Build the parts of a run.

    Raises:
        UserError: the configuration does not fit the robot.
    """
    env = VelocityEnv(robot, run.config.env)
    return Parts(env, make_networks(env.observation_sizes, env.action_size, run.config.ppo), run)
