"""One iteration as one function, which is compiled as a whole: roll out, update, normalise."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from brax.training.acme import running_statistics
from brax.training.agents.ppo.networks import PPONetworks
from jax.sharding import Mesh

from footfall.envs.environment import Environment
from footfall.envs.symmetry import EnvironmentMirror
from footfall.train.actor import LOGGED_OBSERVATIONS
from footfall.train.brax.devices import AXIS, REPLICATED, SHARDED, mean_over_devices
from footfall.train.brax.ppo import Ppo
from footfall.train.brax.rollout import roll_out
from footfall.train.brax.state import MIN_STD, STATE_SPECS, TrainState
from footfall.train.config import PpoConfig

Iteration = Callable[[TrainState], tuple[TrainState, dict[str, jax.Array], jax.Array]]


def make_iteration(
    env: Environment,
    networks: PPONetworks,
    config: PpoConfig,
    mesh: Mesh | None = None,
    mirror: EnvironmentMirror | None = None,
) -> Iteration:
    """The training iteration: from a state to the next one, scalar metrics and a sample of observations.

    Over several devices, each one rolls out and learns from its share of the environments; gradients and
    statistics are averaged. With a mirror, learning is augmented by mirror images.
    """
    devices = 1 if mesh is None else mesh.size
    mean = mean_over_devices(devices)
    ppo = Ppo(networks, config, devices, mirror)

    def iteration(state: TrainState) -> tuple[TrainState, dict[str, jax.Array], jax.Array]:
        device = jnp.int32(0) if devices == 1 else jax.lax.axis_index(AXIS)
        key, step_keys, learn_key = iteration_keys(state, config, device)
        (env_state, observation), (rollout, metrics) = roll_out(env, networks, config, state, step_keys)
        params, optimizer, losses = ppo.update(state, rollout, observation, learn_key)
        # Updated after PPO, so that the rollout's log-probabilities stay comparable.
        normalizer = running_statistics.update(
            state.normalizer,
            rollout.observation,
            std_min_value=MIN_STD,
            pmap_axis_name=AXIS if devices > 1 else None,
        )
        done, length = mean((metrics.pop("done").sum(), metrics.pop("length").sum()))
        scalars = {name: jnp.mean(value) for name, value in metrics.items()}
        scalars |= {f"learning/{name}": jnp.mean(value) for name, value in losses.items()}
        scalars |= {"reward/total": rollout.reward.mean() / env.period_s}
        scalars = mean(scalars) | {"episode/length_s": length / jnp.maximum(done, 1.0) * env.period_s}
        seen = _newest(rollout.observation["state"], LOGGED_OBSERVATIONS // devices)
        next_state = TrainState(
            params, optimizer, normalizer, env_state, observation, key, state.iteration + 1
        )
        return next_state, scalars, seen

    if devices == 1:
        return iteration
    outputs = (STATE_SPECS, REPLICATED, SHARDED)
    return jax.shard_map(iteration, mesh=mesh, in_specs=(STATE_SPECS,), out_specs=outputs, check_vma=False)


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
