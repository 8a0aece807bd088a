"""A training's environment, networks and compiled programs, from its settings."""

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, replace

import jax
import numpy as np
from brax.training.agents.ppo.networks import PPONetworks
from jax.sharding import Mesh

from footfall.common.blocking_threads import COMPILER
from footfall.common.collector import collector_paused
from footfall.envs.environment import Environment
from footfall.envs.make import make_environment
from footfall.envs.symmetry import EnvironmentMirror
from footfall.envs.workarounds.program_cache import load_or_compile
from footfall.robots.description import Robot
from footfall.train.brax.devices import caches_programs, place, shardings
from footfall.train.brax.iteration import Iteration, make_iteration
from footfall.train.brax.networks import make_networks
from footfall.train.brax.prefetch import NAMES, program_key
from footfall.train.brax.programs import Programs
from footfall.train.brax.state import STATE_SPECS, TrainState, initial_state
from footfall.train.config import TrainConfig


@dataclass(frozen=True)
class Parts:
    """The parts of one training."""

    config: TrainConfig
    env: Environment
    networks: PPONetworks

    @property
    def exact_networks(self) -> PPONetworks:
        """The networks in float32 throughout, as they are exported."""
        exact = replace(self.config.ppo, bfloat16=False)
        return make_networks(self.env.observation_sizes, self.env.action_size, exact)

    @property
    def mirror(self) -> EnvironmentMirror | None:
        """Mirror of observations and actions, if the training learns from mirror images; otherwise None.

        Raises:
            UserError: `symmetry` is set and the robot is not symmetric.
        """
        return self.env.mirror() if self.config.ppo.symmetry else None

    @property
    def shapes(self) -> TrainState:
        """Shape and type of everything in a training's state."""
        return jax.eval_shape(self.first_state, np.uint32(0))

    def first_state(self, seed: jax.Array | np.uint32) -> TrainState:
        """The state before the first iteration. All seeds share its program: the seed is an argument."""
        return initial_state(self.env, self.networks, self.config.ppo, seed)

    def iteration(self, mesh: Mesh | None = None) -> Iteration:
        """The training iteration, not compiled."""
        return make_iteration(self.env, self.networks, self.config.ppo, mesh, self.mirror)

    @collector_paused()
    def prepare(
        self, mesh: Mesh, start: TrainState | int, report: Callable[[str], None]
    ) -> tuple[TrainState, Iteration]:
        """The state to begin with, and the compiled iteration, which reuses the memory of its argument.

        Args:
            mesh: the devices to train on.
            start: a checkpoint's state, on the host, or the seed of a new training.
            report: shows one line to the user.
        """
        if self.env.note:
            report(self.env.note)
        # JAX's keys take 32 bits.
        seed = None if isinstance(start, TrainState) else np.uint32(start & 0xFFFFFFFF)
        programs = Programs(self.iteration(mesh), self.first_state, mesh)
        shown_lines: list[str] = []

        def show_once(line: str) -> None:
            if line not in shown_lines:
                shown_lines.append(line)
                report(line)

        key = program_key(self.env.robot, self.config) if caches_programs(mesh) else None

        def program(name: str, lower: Callable[[], jax.stages.Lowered]) -> Future[jax.stages.Compiled]:
            """Loaded from the disk, or traced here and compiled in another thread."""
            if key is None:
                return executor.submit(lower().compile)
            return load_or_compile(lower, executor, show_once, name, *key)

        # Compiled side by side. Nothing may run on the devices meanwhile: XLA times its kernels there.
        executor = ThreadPoolExecutor(len(NAMES), COMPILER)
        try:
            act, learn = program("act", programs.act), program("learn", programs.learn)
            first = None if seed is None else program("first state", programs.first_state)
            wait([each for each in (act, learn, first) if each is not None])
        finally:  # Ctrl-C does not wait for the compiler
            executor.shutdown(wait=False, cancel_futures=True)
        state = place(start, shardings(STATE_SPECS, mesh)) if first is None else first.result()(seed)
        return state, Iteration(act.result(), learn.result())


@collector_paused()
def assemble(config: TrainConfig, robot: Robot) -> Parts:
    """Build the parts of a training.

    Raises:
        UserError: the settings do not fit the robot.
    """
    env = make_environment(robot, config.env)
    return Parts(config, env, make_networks(env.observation_sizes, env.action_size, config.ppo))
