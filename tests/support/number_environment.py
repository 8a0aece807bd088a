"""An environment of a few numbers instead of a robot, for the tests of PPO."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from footfall.train.brax.networks import make_networks
from footfall.train.brax.state import TrainState
from footfall.train.config import PpoConfig, load_preset

SIZES = {"state": 3, "privileged_state": 2}
ACTIONS = 2
REWARD = 3.0
PERIOD_S = 0.02


class NumberEnvironment:
    """The observation is constant. In each step some episodes fall and some others reach the time limit."""

    period_s = PERIOD_S
    observation_sizes, action_size = SIZES, ACTIONS

    def __init__(self, count: int, fallen: int = 0, timed_out: int = 0, observed: float = 1.0) -> None:
        rows = np.arange(count)
        self.count = count
        self.fallen = jnp.float32(rows < fallen)
        self.truncated = jnp.float32((rows >= fallen) & (rows < fallen + timed_out))
        self.observation = {name: jnp.full((count, size), observed) for name, size in SIZES.items()}

    def reward(self, action: jax.Array) -> jax.Array:
        return jnp.full((self.count,), REWARD)

    def reset(self, key: jax.Array, level: jax.Array) -> tuple[jax.Array, dict[str, jax.Array]]:
        return jnp.float32(0.0), {name: value[0] for name, value in self.observation.items()}

    def level(self, steps: jax.Array) -> jax.Array:
        return jnp.float32(steps)

    def at_level(self, state: jax.Array, level: jax.Array) -> jax.Array:
        return jnp.full_like(state, level)

    def step_batch(self, state: jax.Array, action: jax.Array) -> tuple[Any, dict[str, jax.Array], Any]:
        """One control step of all episodes."""
        done = jnp.maximum(self.fallen, self.truncated)
        metrics = {"done": done, "length": 10.0 * done, "level": state}
        reward = self.reward(action)
        return (
            state,
            self.observation,
            SimpleNamespace(reward=reward, truncated=self.truncated, metrics=metrics),
        )


class CountingEnvironment:
    """Six episodes whose observation is the number of their steps, from a random start.

    The first falls in its second step, the second times out in its third.
    """

    period_s = 0.05
    count = 6

    def reset(self, key: jax.Array, level: jax.Array) -> tuple[Any, dict[str, jax.Array]]:
        number = jax.random.uniform(key)
        return number, {name: number * jnp.ones(size) for name, size in SIZES.items()}

    def level(self, steps: jax.Array) -> jax.Array:
        return jnp.float32(steps)

    def at_level(self, state: jax.Array, level: jax.Array) -> jax.Array:
        return state

    def step_batch(self, state: jax.Array, action: jax.Array) -> tuple[Any, dict[str, jax.Array], Any]:
        state = state + 1.0
        rows, done_steps = jnp.arange(self.count), jnp.floor(state)
        fell = ((rows == 0) & (done_steps == 2)) * 1.0
        timed_out = ((rows == 1) & (done_steps == 3)) * 1.0
        observation = {name: state[:, None] * jnp.ones(size) for name, size in SIZES.items()}
        ended = jnp.maximum(fell, timed_out)
        metrics = {"done": ended, "length": ended * done_steps, "steps": done_steps}
        result = SimpleNamespace(reward=10.0 * rows + done_steps, truncated=timed_out, metrics=metrics)
        return state, observation, result


def step_batch(env: Any, state: Any, action: jax.Array) -> Any:
    """Replaces `footfall.envs.batch.step_batch`, which steps one episode at a time."""
    return env.step_batch(state, action)


def with_scaled_actor(state: TrainState) -> TrainState:
    """The state with an actor whose actions depend on the observation more than on noise."""
    policy = jax.tree.map(lambda x: 5.0 * x, state.params.policy)
    return state._replace(params=state.params.replace(policy=policy))


# Settings for a `CountingEnvironment`, with a number of its own for each.
COUNTING: PpoConfig = replace(
    load_preset("smoke").ppo, num_envs=CountingEnvironment.count, num_steps_per_env=3, num_mini_batches=3,
    num_learning_epochs=4, actor_hidden_dims=(6, 5), critic_hidden_dims=(7, 4), init_noise_std=0.37,
    gamma=0.91, lam=0.82, clip_param=0.13, entropy_coef=0.017,
    learning_rate=2e-3, final_learning_rate=2e-3,
)  # fmt: skip
COUNTING_NETWORKS = make_networks(SIZES, ACTIONS, COUNTING)
