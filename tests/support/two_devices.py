"""`train/test_cluster.py` runs this in a process of its own, on a machine of two (host) devices."""

import json
from functools import cache
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import PartitionSpec
from number_environment import COUNTING, COUNTING_NETWORKS, CountingEnvironment, NumberEnvironment, step_batch

from footfall.train.brax import ppo as losses
from footfall.train.brax import rollout as rollouts
from footfall.train.brax.devices import SHARDED, device_mesh, place, shardings
from footfall.train.brax.iteration import make_iteration
from footfall.train.brax.networks import make_networks
from footfall.train.brax.ppo import Ppo
from footfall.train.brax.state import STATE_SPECS, initial_state
from footfall.train.config import load_preset

CONFIG = load_preset("smoke")
ENV: Any = NumberEnvironment(CONFIG.ppo.num_envs)
NETWORKS = make_networks(ENV.observation_sizes, ENV.action_size, CONFIG.ppo)
MESH = device_mesh(CONFIG.ppo)
UNROLL, ENVIRONMENTS = 4, 16  # of one device
Data = tuple[Any, dict[str, jax.Array]]


def rollout(seed: int) -> Data:
    """Random transitions (time, environment) of one device, and the observation after them."""
    from brax.training.types import Transition  # brax imports much unless footfall imports it first

    rng = np.random.default_rng(seed)

    def normal(*shape: int) -> jax.Array:
        return jnp.asarray(rng.normal(size=(UNROLL, ENVIRONMENTS, *shape)), dtype=jnp.float32)

    n, sizes = ENV.action_size, ENV.observation_sizes
    unit = jnp.ones((UNROLL, ENVIRONMENTS, n))
    policy = {"raw_action": normal(n), "log_prob": normal(), "distribution_params": (normal(n), unit)}
    transitions = Transition(
        observation={name: normal(size) for name, size in sizes.items()},
        action=normal(n),
        reward=normal(),
        discount=unit[..., 0],
        next_observation=None,
        extras={"policy_extras": policy, "state_extras": {"truncation": 0 * unit[..., 0]}},
    )
    return transitions, {name: normal(size)[0] for name, size in sizes.items()}


def side_by_side(one: Data, other: Data) -> Data:
    """The data of two devices, along the environments."""
    transitions = jax.tree.map(lambda a, b: jnp.concatenate([a, b], 1), one[0], other[0])
    return transitions, jax.tree.map(lambda a, b: jnp.concatenate([a, b], 0), one[1], other[1])


@cache
def learner(devices: int) -> Any:
    """The compiled update on this number of devices; it gives the actor of each."""
    ppo, key = Ppo(NETWORKS, CONFIG.ppo, devices), jax.random.key(1)
    orders = ppo.orders(key, ENVIRONMENTS)

    def actor(*arguments: Any) -> Any:
        learned, _, _ = ppo.update(*arguments, key, orders=orders)
        return jax.tree.map(lambda x: x[None], learned.policy)

    if devices > 1:
        specs = (STATE_SPECS, PartitionSpec(None, *SHARDED), SHARDED)
        actor = jax.shard_map(actor, mesh=MESH, in_specs=specs, out_specs=SHARDED, check_vma=False)
    return jax.jit(actor)


def learnt(state: Any, data: Data, devices: int) -> list[Any]:
    """The actor that each device ends up with."""
    actors = jax.device_get(learner(devices)(state, *data))
    return [jax.tree.map(lambda x, i=i: x[i], actors) for i in range(devices)]


def statistics_and_expected() -> tuple[Any, Any]:
    """Mean and deviation of the observations after an iteration of counting episodes on both devices."""
    config, networks, env = COUNTING, COUNTING_NETWORKS, CountingEnvironment()
    state = jax.jit(lambda: initial_state(env, networks, config, 3))()
    observations = np.asarray(state.env) + np.arange(config.num_steps_per_env)[:, None]
    env.count //= MESH.size
    rollouts.step_batch = step_batch
    losses.compute_ppo_loss = lambda params, *_, **__: (0.0, {"kl_mean": jnp.float32(0.0)})  # quick to trace
    after = jax.jit(make_iteration(env, networks, config, MESH))(state)[0].normalizer
    return (after.mean["state"], after.std["state"]), (observations.mean(), observations.std())


def gap(a: Any, b: Any) -> float:
    """The largest difference between two trees."""
    leaves = zip(jax.tree.leaves(a), jax.tree.leaves(b), strict=True)
    return max(float(np.max(np.abs(x - y))) for x, y in leaves)


def main() -> None:
    """Print what was seen, as JSON."""
    state = jax.jit(lambda: initial_state(ENV, NETWORKS, CONFIG.ppo, 0))()
    data, other_data = rollout(0), rollout(1)
    (alone,) = learnt(state, data, 1)
    twice, _ = learnt(state, side_by_side(data, data), 2)
    first, second = learnt(state, side_by_side(data, other_data), 2)
    placed = place(jax.device_get(state), shardings(STATE_SPECS, MESH))
    result = {
        "devices": MESH.size,
        "moved": gap(alone, jax.device_get(state.params.policy)),
        "same_share_on_both": gap(alone, twice),
        "other_share_on_the_second": gap(alone, first),
        "between_devices": gap(first, second),
        "statistics": gap(*statistics_and_expected()),
        "environments_of_each": placed.observation["state"].addressable_shards[0].data.shape[0],
        "copies_of_parameters": len(jax.tree.leaves(placed.params)[0].addressable_shards),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
