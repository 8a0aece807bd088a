"""The environment behind rsl_rl's interface: torch tensors over the memory of JAX's arrays."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import torch
from rsl_rl.env import VecEnv
from tensordict import TensorDict

from footfall.envs.batch import step_batch
from footfall.envs.environment import Environment
from footfall.envs.state import State, Step


class Episodes(NamedTuple):
    """A batch of episodes."""

    state: State
    observation: dict[str, jax.Array]  # for the next actions


class TorchEnvironment(VecEnv):
    """A batch of episodes behind rsl_rl's interface.

    Arrays pass both ways by DLPack without a copy, on the CPU and on a GPU. The receiver waits until an
    array is computed; on a GPU, its stream waits. No memory is reused too early, because the two sides take
    turns: torch reads the observations before it computes the actions, and the step reads the actions
    before it computes the next observations. A donated array would break this, so nothing is donated.
    """

    def __init__(self, env: Environment, environments: int, seed: int) -> None:
        """Begin an episode in each environment. JAX's default device becomes torch's."""
        self.cfg = env.config
        self.num_envs = environments
        self.num_actions = env.action_size
        self.max_episode_length = env.episode_steps
        self.steps_done = 0  # in all environments, for the curriculum; the trainer sets it
        self._step = jax.jit(_make_step(env))
        self._metrics: list[dict[str, jax.Array]] = []
        self._period_s = env.period_s
        keys = jax.random.split(jax.random.PRNGKey(seed), environments)
        self.put(Episodes(*jax.jit(jax.vmap(env.reset, (0, None)))(keys, env.level(jnp.float32(0.0)))))
        self.device: torch.device = self.get_observations()["state"].device
        action = torch.zeros((environments, env.action_size), device=self.device)
        # Compile the step, and wait for the result: a process that ends earlier, such as an export, could
        # be aborted when JAX's thread releases the tensor.
        jax.block_until_ready(self._step(self.episodes, jax.dlpack.from_dlpack(action), 0.0))

    def put(self, episodes: Episodes) -> None:
        """Continue with these episodes."""
        # Committed to the device, as arrays from torch are; otherwise the step would be compiled twice.
        self.episodes = jax.device_put(episodes, jax.devices()[0])

    @property
    def episode_length_buf(self) -> torch.Tensor:
        """Control steps since each episode began."""
        return torch.from_dlpack(self.episodes.state.steps)

    def get_observations(self) -> TensorDict:
        """Observations of the actor ("state") and the critic ("privileged_state"), (environments, size)."""
        observations = {name: torch.from_dlpack(value) for name, value in self.episodes.observation.items()}
        return TensorDict(observations, batch_size=[self.num_envs], device=observations["state"].device)

    def step(self, actions: torch.Tensor) -> tuple[TensorDict, torch.Tensor, torch.Tensor, dict]:
        """One control step; actions of shape (environments, n). See rsl_rl's `VecEnv.step`."""
        action = jax.dlpack.from_dlpack(actions.detach())
        self.episodes, step, means = self._step(self.episodes, action, float(self.steps_done))
        self._metrics.append(means)
        reward, done, truncated = (
            torch.from_dlpack(value) for value in (step.reward, step.metrics["done"], step.truncated)
        )
        return self.get_observations(), reward, done, {"time_outs": truncated}

    def take_metrics(self) -> dict[str, float]:
        """Means over all environments and over the steps since the last call."""
        means = {name: float(value) for name, value in jax.device_get(_mean(self._metrics)).items()}
        ended_episodes = means.pop("done") * len(self._metrics) * self.num_envs
        length = means.pop("length") * len(self._metrics) * self.num_envs / max(ended_episodes, 1.0)
        self._metrics.clear()
        return means | {"episode/length_s": length * self._period_s}


def _make_step(env: Environment) -> Callable:
    """The function to compile: one control step of all episodes, and means of its metrics."""

    def step(
        episodes: Episodes, action: jax.Array, steps_done: float
    ) -> tuple[Episodes, Step, dict[str, jax.Array]]:
        level = env.level(jnp.asarray(steps_done))
        state, observation, step = step_batch(env, env.at_level(episodes.state, level), action)
        means = {name: jnp.mean(value) for name, value in step.metrics.items()}
        means["reward/total"] = jnp.mean(step.reward) / env.period_s
        return Episodes(state, observation), step, means

    return step


@jax.jit
def _mean(steps: list[dict[str, jax.Array]]) -> dict[str, jax.Array]:
    """Means over steps, in one transfer from the device."""
    return jax.tree.map(lambda *values: jnp.mean(jnp.stack(values)), *steps)
