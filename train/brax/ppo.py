"""One PPO update: epochs of mini-batches over one rollout.

The mathematics is brax's (networks, loss, advantage estimation, running statistics). The loop is footfall's:
all of a training's state is in one place, so that it resumes exactly.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax
from brax.training.agents.ppo.losses import PPONetworkParams, compute_ppo_loss
from brax.training.agents.ppo.networks import PPONetworks
from brax.training.agents.ppo.optimizer import adaptive_kl_learning_rate
from brax.training.types import Transition

from footfall.envs.symmetry import EnvironmentMirror
from footfall.envs.workarounds.fewer_kernels import fewer_kernels
from footfall.train.brax.devices import mean_over_devices
from footfall.train.brax.networks import normalised
from footfall.train.brax.state import TrainState, make_optimizer
from footfall.train.brax.symmetry import mirror_half, with_mirror_images
from footfall.train.config import PpoConfig

MIN_LEARNING_RATE = 1e-5


class Learner(NamedTuple):
    """State that a gradient step changes."""

    params: PPONetworkParams
    optimizer: Any
    key: jax.Array


@dataclass(frozen=True)
class Ppo:
    """PPO on one or more devices, which average their gradients. A mirror adds mirror images."""

    networks: PPONetworks
    config: PpoConfig
    devices: int = 1
    mirror: EnvironmentMirror | None = None

    def orders(self, key: jax.Array, environments: int) -> jax.Array:
        """The order of the environments in each epoch of an update with this key, (epoch, environment)."""
        keys = jax.random.split(key, self.config.num_learning_epochs + 1)
        return jax.vmap(jax.random.permutation, (0, None))(keys[1:], environments)

    def update(
        self,
        state: TrainState,
        rollout: Transition,
        observation: dict[str, jax.Array],
        key: jax.Array,
        summarise: Callable[[dict[str, jax.Array]], Any] = lambda losses: losses,
        orders: jax.Array | None = None,
    ) -> tuple[PPONetworkParams, Any, Any]:
        """Learn from a rollout, arrays of shape (time, environment, ...), and the observation after it.

        Args:
            state: the training's state before the rollout.
            rollout: its transitions.
            observation: the observation after it.
            key: the update's random key.
            summarise: returns what to keep of a mini-batch's losses.
            orders: the environments' `orders`, drawn here if None. A `shard_map` needs them from outside,
                because XLA's older partitioner aborts at sorts (envs/workarounds/partitioner.py).

        Returns:
            Parameters, the optimiser's state, and each mini-batch's summary, (epoch, mini-batch, ...).
        """
        data = self._samples(state, rollout, observation)
        limit = self.config.learning_rate_limit(state.iteration)
        adaptive = self.config.desired_kl is not None
        rate = jnp.minimum(learning_rate(state.optimizer), limit) if adaptive else limit
        if orders is None:
            orders = self.orders(key, rollout.reward.shape[1])
        first_key = jax.random.split(key, self.config.num_learning_epochs + 1)[0]
        learner = Learner(state.params, with_learning_rate(state.optimizer, rate), first_key)
        entropy = self.config.entropy_weight(state.iteration)
        epoch = partial(self._epoch, data=data, limit=limit, entropy=entropy, summarise=summarise)
        learner, losses = jax.lax.scan(epoch, learner, orders)
        return learner.params, learner.optimizer, losses

    def _epoch(self, learner: Learner, order: jax.Array, **common: Any) -> tuple[Learner, Any]:
        """One epoch: each environment once, in this order. All mini-batches share `common`."""
        key, mirror_key = jax.random.split(learner.key)
        if self.mirror is not None:
            order = mirror_half(order, mirror_key)
        batches = order.reshape((self.config.num_mini_batches, -1))
        step = partial(self._mini_batch, **common)
        return jax.lax.scan(step, learner._replace(key=key), batches)

    def _mini_batch(
        self,
        learner: Learner,
        environments: jax.Array,
        data: Transition,
        limit: jax.Array,
        entropy: jax.Array,
        summarise: Callable[[dict[str, jax.Array]], Any],
    ) -> tuple[Learner, Any]:
        """One gradient step on the samples of these environments."""
        config, mean = self.config, mean_over_devices(self.devices)
        key, loss_key = jax.random.split(learner.key)
        # brax's loss takes (environment, time) and swaps the axes again: no data moves.
        batch = jax.tree.map(lambda x: jnp.swapaxes(_columns(x, environments), 0, 1), data)
        with fewer_kernels():
            gradient, losses = jax.grad(self._loss, has_aux=True)(learner.params, batch, loss_key, entropy)
        gradient, losses["kl_mean"] = mean((gradient, losses["kl_mean"]))
        updates, optimizer = make_optimizer(config).update(gradient, learner.optimizer, learner.params)
        losses["gradient_norm"] = optax.global_norm(gradient)
        if config.desired_kl is not None:
            optimizer, _ = adaptive_kl_learning_rate(
                optimizer, losses["kl_mean"], config.desired_kl, MIN_LEARNING_RATE, limit
            )
        losses["learning_rate"] = learning_rate(optimizer)
        return Learner(optax.apply_updates(learner.params, updates), optimizer, key), summarise(losses)

    def _loss(
        self, params: PPONetworkParams, batch: Transition, key: jax.Array, entropy: jax.Array
    ) -> tuple[jax.Array, dict]:
        return compute_ppo_loss(
            params,
            None,  # the batch is normalised already
            batch,
            key,
            ppo_network=self.networks,
            entropy_cost=entropy,
            discounting=self.config.gamma,
            gae_lambda=self.config.lam,
            clipping_epsilon=self.config.clip_param,
        )

    def _samples(
        self, state: TrainState, rollout: Transition, observation: dict[str, jax.Array]
    ) -> Transition:
        """The rollout with normalised observations, and with mirror images where there is a mirror."""
        # Of the next observations the loss reads the last one only.
        data = rollout._replace(next_observation=jax.tree.map(lambda x: x[None], observation))
        if self.mirror is not None:
            behaviour = (state.normalizer, state.params.policy)
            data = with_mirror_images(data, self.mirror, self.networks, behaviour)
        return data._replace(
            observation=normalised(data.observation, state.normalizer, self.config),
            next_observation=normalised(data.next_observation, state.normalizer, self.config),
        )


def _columns(x: jax.Array, columns: jax.Array) -> jax.Array:
    """`x[:, columns]` as a gather of rows: XLA gathers columns into another order, and transposes them."""
    rows = jnp.arange(x.shape[0])[:, None] * x.shape[1] + columns
    return x.reshape((-1, *x.shape[2:]))[rows]


def learning_rate(optimizer_state: Any) -> jax.Array:
    """Adam's learning rate."""
    return optimizer_state[-1].hyperparams["learning_rate"]


def with_learning_rate(optimizer_state: Any, rate: jax.Array) -> Any:
    adam = optimizer_state[-1]
    changed = adam._replace(hyperparams={**adam.hyperparams, "learning_rate": rate})
    return (*optimizer_state[:-1], changed)
