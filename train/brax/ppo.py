"""Proximal policy optimisation: one iteration as one compiled function.

The mathematics is brax's (networks, loss, advantage estimation, running statistics); the loop is ours,
so that all of its state is in one place and resumes exactly.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optax
from brax.training.acme import running_statistics
from brax.training.agents.ppo.losses import PPONetworkParams, compute_ppo_loss
from brax.training.agents.ppo.networks import PPONetworks, make_inference_fn
from brax.training.agents.ppo.optimizer import adaptive_kl_learning_rate
from brax.training.types import Transition
from jax.sharding import Mesh

from footfall.envs.batch import step_batch
from footfall.envs.state import State
from footfall.envs.symmetry import EnvironmentMirror
from footfall.envs.velocity import VelocityEnv
from footfall.envs.workarounds.fewer_kernels import fewer_kernels
from footfall.train.brax.devices import AXIS, DIVIDED, EACH, mean_over_devices
from footfall.train.brax.networks import normalised
from footfall.train.brax.symmetry import mirror_half, with_mirror_images
from footfall.train.config import PpoConfig

LEAST_LEARNING_RATE = 1e-5
LEAST_STD = 0.02  # of a normalised observation: a reading that hardly varies is not blown up
LOGGED_OBSERVATIONS = 1000  # kept from each iteration, for the export's parity check


class TrainState(NamedTuple):
    """Everything that a training is: the next iteration depends on nothing else."""

    params: PPONetworkParams
    optimizer: Any
    normalizer: running_statistics.RunningStatisticsState
    env: State
    observation: dict[str, jax.Array]
    key: jax.Array
    iteration: jax.Array


_WHERE: dict[str, Any] = dict.fromkeys(TrainState._fields, EACH) | {"env": DIVIDED, "observation": DIVIDED}
STATE_SPECS = TrainState(**_WHERE)  # how each part of a state lies on several devices


def make_optimizer(config: PpoConfig) -> optax.GradientTransformation:
    """Adam under a gradient-norm limit; its learning rate is set from outside."""
    adam = optax.inject_hyperparams(optax.adam)(learning_rate=config.learning_rate)
    return optax.chain(optax.clip_by_global_norm(config.max_grad_norm), adam)


def learning_rate_limit(iteration: jax.Array, config: PpoConfig) -> jax.Array:
    """The learning rate, or its upper limit where it adapts: falls linearly over the training."""
    share = iteration / config.iterations
    return config.learning_rate + share * (config.final_learning_rate - config.learning_rate)


def initial_state(
    env: VelocityEnv, networks: PPONetworks, config: PpoConfig, seed: jax.Array | np.uint32 | int
) -> TrainState:
    """The state before the first iteration."""
    key, env_key, actor_key, critic_key = jax.random.split(jax.random.PRNGKey(seed), 4)
    keys = jax.random.split(env_key, config.num_envs)
    env_state, observation = jax.vmap(env.reset, (0, None))(keys, env.level(jnp.float32(0.0)))
    params = PPONetworkParams(
        policy=networks.policy_network.init(actor_key), value=networks.value_network.init(critic_key)
    )
    one = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape[1:]), observation)
    state = TrainState(
        params=params,
        optimizer=make_optimizer(config).init(params),
        normalizer=running_statistics.init_state(one),
        env=env_state,
        observation=observation,
        key=key,
        iteration=jnp.int32(0),
    )
    # Python scalars in a state have weak types, which would make the second iteration compile again.
    return jax.tree.map(lambda x: jax.lax.convert_element_type(x, jnp.asarray(x).dtype), state)


def make_iteration(
    env: VelocityEnv,
    networks: PPONetworks,
    config: PpoConfig,
    mesh: Mesh | None = None,
    mirror: EnvironmentMirror | None = None,
) -> Callable[[TrainState], tuple[TrainState, dict[str, jax.Array], jax.Array]]:
    """The function from a state to the next: roll out, learn, normalise.

    Over several devices, each one rolls out and learns from its share of the environments; gradients and
    statistics are averaged. With a mirror, learning is augmented by mirror images.

    It returns the new state, scalar metrics, and some of the observations that the actor saw.
    """
    devices = 1 if mesh is None else mesh.size
    mean = mean_over_devices(devices)
    roll_out, learn = make_rollout(env, networks, config), make_learning(networks, config, devices, mirror)

    def iteration(state: TrainState) -> tuple[TrainState, dict[str, jax.Array], jax.Array]:
        device = jnp.int32(0) if devices == 1 else jax.lax.axis_index(AXIS)
        key, step_keys, learn_key = iteration_keys(state, config, device)
        (env_state, observation), (rollout, metrics) = roll_out(state, step_keys)
        params, optimizer_state, losses = learn(state, rollout, observation, learn_key)
        # Updated after learning, so that the behaviour's log-probabilities stay comparable.
        normalizer = running_statistics.update(
            state.normalizer,
            rollout.observation,
            std_min_value=LEAST_STD,
            pmap_axis_name=AXIS if devices > 1 else None,
        )
        done, length = mean((metrics.pop("done").sum(), metrics.pop("length").sum()))
        scalars = {name: jnp.mean(value) for name, value in metrics.items()}
        scalars |= {f"learning/{name}": jnp.mean(value) for name, value in losses.items()}
        scalars |= {"reward/total": rollout.reward.mean() / env.period_s}
        scalars = mean(scalars) | {"episode/length_s": length / jnp.maximum(done, 1.0) * env.period_s}
        logged = LOGGED_OBSERVATIONS // devices
        seen = rollout.observation["state"]
        kept = seen[-1, :logged]
        if kept.shape[0] < logged:
            kept = seen.reshape((-1, seen.shape[-1]))[-logged:]
        next_state = TrainState(
            params, optimizer_state, normalizer, env_state, observation, key, state.iteration + 1
        )
        return next_state, scalars, kept

    if devices == 1:
        return iteration
    outputs = (STATE_SPECS, EACH, DIVIDED)
    return jax.shard_map(iteration, mesh=mesh, in_specs=(STATE_SPECS,), out_specs=outputs, check_vma=False)


def iteration_keys(
    state: TrainState, config: PpoConfig, device: jax.Array | int = 0
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """An iteration's randomness: the next state's key, a key for each control step, and learning's.

    The first is the same on each device, the others are not.
    """
    key, rollout_key, learn_key = jax.random.split(state.key, 3)
    rollout_key, learn_key = jax.random.fold_in(rollout_key, device), jax.random.fold_in(learn_key, device)
    return key, jax.random.split(rollout_key, config.num_steps_per_env), learn_key


def make_rollout(
    env: VelocityEnv, networks: PPONetworks, config: PpoConfig
) -> Callable[[TrainState, jax.Array], tuple[tuple, tuple[Transition, dict[str, jax.Array]]]]:
    """The function that acts for one control step per key.

    It returns the environments' state and observation to go on with, and of each step (time, environment)
    the transition and the environment's metrics.
    """
    make_policy = make_inference_fn(networks)

    def environment_step(carry: tuple, key: jax.Array, policy: Callable) -> tuple[tuple, tuple]:
        env_state, observation = carry
        action, policy_extras = policy(observation, key)
        env_state, next_observation, step = step_batch(env, env_state, action)
        transition = Transition(
            observation=observation,
            action=action,
            reward=step.reward,
            discount=1.0 - step.metrics["done"],
            next_observation=None,  # the loss reads the last one only; see `learn`
            extras={"policy_extras": policy_extras, "state_extras": {"truncation": step.truncated}},
        )
        return (env_state, next_observation), (transition, step.metrics)

    def roll_out(state: TrainState, keys: jax.Array) -> tuple[tuple, tuple[Transition, dict[str, jax.Array]]]:
        policy = make_policy((state.normalizer, state.params.policy))
        level = env.level(state.iteration * float(config.steps_per_iteration))
        start = (env.at_level(state.env, level), state.observation)
        return jax.lax.scan(partial(environment_step, policy=policy), start, keys)

    return roll_out


def make_learning(
    networks: PPONetworks, config: PpoConfig, devices: int = 1, mirror: EnvironmentMirror | None = None
) -> Callable[[TrainState, Transition, dict[str, jax.Array], jax.Array], tuple[Any, Any, dict]]:
    """The function that learns from a rollout and the observation after it, on each of some devices.

    It returns parameters, the optimiser's state, and the losses (pass, minibatch).
    """
    optimizer, mean = make_optimizer(config), mean_over_devices(devices)
    loss = partial(
        compute_ppo_loss,
        ppo_network=networks,
        entropy_cost=config.entropy_coef,
        discounting=config.gamma,
        gae_lambda=config.lam,
        clipping_epsilon=config.clip_param,
    )

    def minibatch(carry: tuple, columns: jax.Array, data: Transition, limit: jax.Array) -> tuple[tuple, dict]:
        params, optimizer_state, key = carry
        key, loss_key = jax.random.split(key)
        # brax's loss wants (environment, time) and swaps them again: nothing is moved.
        batch = jax.tree.map(lambda x: jnp.swapaxes(_columns(x, columns), 0, 1), data)
        with fewer_kernels():
            gradient, metrics = jax.grad(loss, has_aux=True)(params, None, batch, loss_key)
        gradient, metrics["kl_mean"] = mean((gradient, metrics["kl_mean"]))
        updates, optimizer_state = optimizer.update(gradient, optimizer_state, params)
        metrics["gradient_norm"] = optax.global_norm(gradient)
        if config.desired_kl is not None:
            optimizer_state, _ = adaptive_kl_learning_rate(
                optimizer_state, metrics["kl_mean"], config.desired_kl, LEAST_LEARNING_RATE, limit
            )
        metrics["learning_rate"] = _learning_rate(optimizer_state)
        return (optax.apply_updates(params, updates), optimizer_state, key), metrics

    def one_pass(carry: tuple, columns: jax.Array, data: Transition, limit: jax.Array) -> tuple[tuple, dict]:
        params, optimizer_state, key = carry
        key, mirror_key = jax.random.split(key)
        if mirror is not None:
            columns = mirror_half(columns, mirror_key)
        return jax.lax.scan(
            partial(minibatch, data=data, limit=limit),
            (params, optimizer_state, key),
            columns.reshape((config.num_mini_batches, -1)),
        )

    def learn(
        state: TrainState, rollout: Transition, observation: dict[str, jax.Array], key: jax.Array
    ) -> tuple[Any, Any, dict]:
        # Of the next observations the loss reads the last one only.
        data = rollout._replace(next_observation=jax.tree.map(lambda x: x[None], observation))
        if mirror is not None:
            data = with_mirror_images(data, mirror, networks, (state.normalizer, state.params.policy))
        data = data._replace(
            observation=normalised(data.observation, state.normalizer, config),
            next_observation=normalised(data.next_observation, state.normalizer, config),
        )
        limit = learning_rate_limit(state.iteration, config)
        rate = limit if config.desired_kl is None else jnp.minimum(_learning_rate(state.optimizer), limit)
        # Drawn before the passes: inside them XLA's older partitioner, which jax 0.11 needs for several
        # devices, cannot divide the sort (envs/workarounds/partitioner.py).
        key, *shuffle_keys = jax.random.split(key, config.num_learning_epochs + 1)
        orders = jnp.stack([jax.random.permutation(k, rollout.reward.shape[1]) for k in shuffle_keys])
        (params, optimizer_state, _), losses = jax.lax.scan(
            partial(one_pass, data=data, limit=limit),
            (state.params, _with_learning_rate(state.optimizer, rate), key),
            orders,
        )
        return params, optimizer_state, losses

    return learn


def _columns(x: jax.Array, columns: jax.Array) -> jax.Array:
    """`x[:, columns]` as a gather of rows: XLA gathers columns into another order, and transposes them."""
    rows = jnp.arange(x.shape[0])[:, None] * x.shape[1] + columns
    return x.reshape((-1, *x.shape[2:]))[rows]


def _learning_rate(optimizer_state: Any) -> jax.Array:
    return optimizer_state[-1].hyperparams["learning_rate"]


def _with_learning_rate(optimizer_state: Any, rate: jax.Array) -> Any:
    adam = optimizer_state[-1]
    changed = adam._replace(hyperparams={**adam.hyperparams, "learning_rate": rate})
    return (*optimizer_state[:-1], changed)
