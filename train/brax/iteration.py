"""One iteration in two halves, which are compiled side by side: act, then learn."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from brax.training.agents.ppo.networks import PPONetworks
from brax.training.types import Transition
from jax.sharding import Mesh, NamedSharding

from footfall.envs.environment import Environment
from footfall.envs.symmetry import EnvironmentMirror
from footfall.train.actor import LOGGED_OBSERVATIONS
from footfall.train.brax import statistics
from footfall.train.brax.devices import AXIS, REPLICATED, SHARDED, SHARDED_ROLLOUT, mean_over_devices
from footfall.train.brax.ppo import Ppo
from footfall.train.brax.rollout import Episodes, roll_out
from footfall.train.brax.state import LEARNER_SPECS, TrainState
from footfall.train.config import PpoConfig
from footfall.train.stacked import StackedScalars


class Experience(NamedTuple):
    """Training data from a rollout, and its metrics."""

    rollout: Transition  # arrays (time, environment, ...)
    metrics: Any  # StackedScalars: means of each device, arrays (device,)


EPISODE_SPECS = (SHARDED, SHARDED)  # how each half's arguments and results are sharded over several devices
EXPERIENCE_SPECS = Experience(SHARDED_ROLLOUT, SHARDED)
LEARNED_SPECS = (LEARNER_SPECS, REPLICATED, SHARDED)
Learned = tuple[TrainState, StackedScalars, jax.Array]


@dataclass(frozen=True)
class Iteration:
    """A training iteration: from a state to the next one, scalar metrics and a sample of observations."""

    act: Callable[[Episodes, TrainState], tuple[Episodes, Experience]]
    learn: Callable[[TrainState, dict[str, jax.Array], Experience], Learned]

    def __call__(self, state: TrainState) -> Learned:
        """Roll out, then learn from the rollout. Compiled halves reuse the memory of the state."""
        episodes, learner = state.episodes, state.learner
        episodes, experience = self.act(episodes, learner)
        learner, metrics, observations = self.learn(learner, episodes[1], experience)
        return learner.with_episodes(episodes), metrics, observations


def make_iteration(
    env: Environment,
    networks: PPONetworks,
    config: PpoConfig,
    mesh: Mesh | None = None,
    mirror: EnvironmentMirror | None = None,
) -> Iteration:
    """The training iteration, not compiled.

    Over several devices, each one rolls out and learns from its share of the environments; gradients and
    statistics are averaged. With a mirror, learning is augmented by mirror images.
    """
    devices = 1 if mesh is None else mesh.size
    mean = mean_over_devices(devices)
    ppo = Ppo(networks, config, devices, mirror)

    def device() -> jax.Array:
        return jnp.int32(0) if devices == 1 else jax.lax.axis_index(AXIS)

    def act(episodes: Episodes, learner: TrainState) -> tuple[Episodes, Experience]:
        _, step_keys, _ = iteration_keys(learner, config, device())
        state = learner.with_episodes(episodes)
        episodes, (rollout, means) = roll_out(env, networks, config, state, step_keys, _means)
        reward = {"reward/total": rollout.reward.mean() / env.period_s}
        metrics = StackedScalars.of(dict(means.mean(axis=0)) | reward)
        return episodes, Experience(rollout, jax.tree.map(lambda x: x[None], metrics))

    def learn(
        learner: TrainState,
        observation: dict[str, jax.Array],
        experience: Experience,
        orders: jax.Array | None = None,
    ) -> Learned:
        rollout = experience.rollout
        key, _, learn_key = iteration_keys(learner, config, device())
        own_orders = None if orders is None else orders[:, 0]  # (epoch, environment) of this device
        params, optimizer, losses = ppo.update(learner, rollout, observation, learn_key, _means, own_orders)
        metrics = experience.metrics.mean(axis=0)
        moments = statistics.moments(learner.normalizer, rollout.observation) if devices > 1 else None
        metrics, losses, moments = mean((metrics, losses.mean(axis=(0, 1)), moments))
        # Updated after PPO, so that the rollout's log-probabilities stay comparable.
        if moments is None:
            normalizer = statistics.add_samples(learner.normalizer, rollout.observation)
        else:
            normalizer = statistics.add_moments(learner.normalizer, moments, config.steps_per_iteration)
        scalars = {f"learning/{name}": value for name, value in losses.items()}
        scalars |= _with_episode_length(metrics, 1.0 / config.steps_per_iteration, env.period_s)
        observations = _newest(rollout.observation["state"], LOGGED_OBSERVATIONS // devices)
        learner = learner._replace(
            params=params,
            optimizer=optimizer,
            normalizer=normalizer,
            key=key,
            iteration=learner.iteration + 1,
        )
        return learner, StackedScalars.of(scalars), observations

    if mesh is None or devices == 1:
        return Iteration(act, learn)

    def draw_orders(device: jax.Array, learner: TrainState) -> jax.Array:
        _, _, learn_key = iteration_keys(learner, config, device)
        return ppo.orders(learn_key, config.num_envs // devices)

    return _on_each_device(act, learn, draw_orders, mesh)


def _on_each_device(
    act: Callable[..., Any], learn: Callable[..., Any], draw_orders: Callable[..., jax.Array], mesh: Mesh
) -> Iteration:
    """The halves on each device's share. `draw_orders` takes a device's index and the learner."""

    def sharded(half: Callable[..., Any], arguments: Any, results: Any) -> Callable[..., Any]:
        return jax.shard_map(half, mesh=mesh, in_specs=arguments, out_specs=results, check_vma=False)

    learn_sharded = sharded(learn, (LEARNER_SPECS, SHARDED, EXPERIENCE_SPECS, SHARDED_ROLLOUT), LEARNED_SPECS)
    sharding = NamedSharding(mesh, SHARDED_ROLLOUT)

    def learn_all(learner: TrainState, observation: dict[str, jax.Array], experience: Experience) -> Learned:
        devices = jnp.arange(mesh.size)
        orders = jax.vmap(draw_orders, (0, None), 1)(devices, learner)  # (epoch, device, environment)
        orders = jax.lax.with_sharding_constraint(orders, sharding)  # each device sorts its own
        return learn_sharded(learner, observation, experience, orders)

    return Iteration(
        sharded(act, (EPISODE_SPECS, LEARNER_SPECS), (EPISODE_SPECS, EXPERIENCE_SPECS)), learn_all
    )


def _means(values: dict[str, jax.Array]) -> StackedScalars:
    """The mean of each value, all in one array: each output of a scan takes a kernel or two."""
    return StackedScalars.of({name: jnp.mean(value) for name, value in values.items()})


def _with_episode_length(metrics: StackedScalars, min_done: float, period_s: float) -> dict[str, jax.Array]:
    """The metrics with the mean length of the episodes that ended, in seconds, instead of their sum."""
    scalars = dict(metrics)
    done, length = scalars.pop("done"), scalars.pop("length")
    return scalars | {"episode/length_s": length / jnp.maximum(done, min_done) * period_s}


def iteration_keys(
    state: TrainState, config: PpoConfig, device: jax.Array | int = 0
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """An iteration's randomness: the next state's key, a key for each control step, and the update's key.

    The first is the same on each device, the others differ.
    """
    key, rollout_key, learn_key = jax.random.split(state.key, 3)
    rollout_key, learn_key = jax.random.fold_in(rollout_key, device), jax.random.fold_in(learn_key, device)
    return key, jax.random.split(rollout_key, config.num_steps_per_env), learn_key


def _newest(observations: jax.Array, count: int) -> jax.Array:
    """At most the last `count` observations of (time, environment, size)."""
    newest = observations[-1, :count]
    if newest.shape[0] == count:
        return newest
    return observations.reshape((-1, observations.shape[-1]))[-count:]
