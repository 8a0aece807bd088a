"""The state of a brax training."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from brax.training.acme import running_statistics
from brax.training.agents.ppo.losses import PPONetworkParams
from brax.training.agents.ppo.networks import PPONetworks

from footfall.envs.environment import Environment
from footfall.envs.state import State
from footfall.train.brax.devices import REPLICATED, SHARDED
from footfall.train.config import PpoConfig

_NO_EPISODES: dict[str, Any] = {"env": (), "observation": ()}


class TrainState(NamedTuple):
    """The whole state of a training: the next iteration depends on nothing else."""

    params: PPONetworkParams
    optimizer: Any
    normalizer: running_statistics.RunningStatisticsState
    env: State
    observation: dict[str, jax.Array]
    key: jax.Array
    iteration: jax.Array

    @property
    def episodes(self) -> tuple[State, dict[str, jax.Array]]:
        """The environments' states, and the observations for the next actions."""
        return self.env, self.observation

    @property
    def learner(self) -> "TrainState":
        """The state without its episodes: their fields are empty."""
        return self._replace(**_NO_EPISODES)

    def with_episodes(self, episodes: tuple[State, dict[str, jax.Array]]) -> "TrainState":
        """The state with these episodes."""
        env, observation = episodes
        return self._replace(env=env, observation=observation)


_SPECS: dict[str, Any] = dict.fromkeys(TrainState._fields, REPLICATED) | {
    "env": SHARDED,
    "observation": SHARDED,
}
STATE_SPECS = TrainState(**_SPECS)  # how each part of a state lies on several devices
LEARNER_SPECS = STATE_SPECS.learner


def make_optimizer(config: PpoConfig) -> optax.GradientTransformation:
    """Adam with clipped gradient norm; the learning rate is part of its state."""
    adam = optax.inject_hyperparams(optax.adam)(learning_rate=config.learning_rate)
    return optax.chain(optax.clip_by_global_norm(config.max_grad_norm), adam)


def initial_state(
    env: Environment, networks: PPONetworks, config: PpoConfig, seed: jax.Array | np.uint32 | int
) -> TrainState:
    """The state before the first iteration."""
    key, env_key, actor_key, critic_key = jax.random.split(jax.random.PRNGKey(seed), 4)
    keys = jax.random.split(env_key, config.num_envs)
    env_state, observation = jax.vmap(env.reset, (0, None))(keys, env.level(jnp.float32(0.0)))
    params = PPONetworkParams(
        policy=networks.policy_network.init(actor_key), value=networks.value_network.init(critic_key)
    )
    example = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape[1:]), observation)
    state = TrainState(
        params=params,
        optimizer=make_optimizer(config).init(params),
        normalizer=running_statistics.init_state(example),
        env=env_state,
        observation=observation,
        key=key,
        iteration=jnp.int32(0),
    )
    # Python scalars in a state have weak types, which would make the second iteration compile again.
    return jax.tree.map(lambda x: jax.lax.convert_element_type(x, jnp.asarray(x).dtype), state)
