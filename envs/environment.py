"""The protocol of an environment, used by trainers, the gymnasium environments and benchmarks.

A batch of episodes is a `jax.vmap` of `reset` and `step` (envs/batch.py). `envs/make.py` makes an environment
from a robot and a configuration; no other module names a class that implements this protocol.
"""

from typing import Protocol

import jax

from footfall.envs.config import EnvConfig
from footfall.envs.state import State, Step
from footfall.envs.symmetry import EnvironmentMirror
from footfall.policies.contract import Contract
from footfall.robots.description import Robot


class Episodes(Protocol):
    """The part of an environment that steps episodes and restarts those that ended.

    An environment whose next episode depends on the previous one may also have `restart(state)`: it returns
    the same as `reset`, from the last state of an episode.
    """

    @property
    def on_host(self) -> bool:
        """Whether physics runs on the host's CPU, where branches of a program cost little."""

    def reset(self, key: jax.Array, level: jax.Array | float = 1.0) -> tuple[State, dict[str, jax.Array]]:
        """One new episode.

        Args:
            key: random key of JAX's random numbers, shape (2,).
            level: level of the curriculum, 0 to 1.

        Returns:
            The state, and the observations: "state" of the actor, "privileged_state" of the critic.
        """

    def step(self, state: State, action: jax.Array) -> tuple[State, Step]:
        """One control step of one episode; action of shape (action_size,)."""


class Environment(Episodes, Protocol):
    """One robot, one task. Holds constants only: `reset` and `step` are pure functions."""

    robot: Robot
    config: EnvConfig
    contract: Contract  # of the policies that are trained in it
    action_size: int
    period_s: float  # a control step
    episode_steps: int  # control steps until an episode is truncated

    @property
    def note(self) -> str:
        """One line for the user before training; empty if there is nothing to tell."""

    @property
    def observation_sizes(self) -> dict[str, int]:
        """Size of each observation that `reset` and `step` return."""

    def level(self, steps: jax.Array) -> jax.Array:
        """The curriculum's level, 0 to 1, after `steps` environment steps of the whole training."""

    def at_level(self, state: State, level: jax.Array) -> State:
        """The same batch of episodes at another level of the curriculum."""

    def mirror(self) -> EnvironmentMirror:
        """Mirror images of observations and actions.

        Raises:
            UserError: the robot or its task has no mirror image.
        """
