"""Proximal policy optimisation: one iteration as one compiled function.

The mathematics is brax's (networks, loss, advantage estimation, running statistics); the loop is ours,
so that all of its state is in one place and resumes exactly.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import optax
from brax.training.acme import running_statistics
from brax.training.agents.ppo.losses import PPONetworkParams, compute_ppo_loss
from brax.training.agents.ppo.networks import PPONetworks, make_inference_fn
from brax.training.agents.ppo.optimizer import adaptive_kl_learning_rate
from brax.training.types import Transition

from envs.velocity import State, VelocityEnv
from train.config import PpoConfig

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


def make_optimizer(config: PpoConfig) -> optax.GradientTransformation:
    """Adam under a gradient-norm limit; its learning rate is set from outside."""
    adam = optax.inject_hyperparams(optax.adam)(learning_rate=config.learning_rate)
    return optax.chain(optax.clip_by_global_norm(config.gradient_norm), adam)


def learning_rate_limit(iteration: jax.Array, config: PpoConfig) -> jax.Array:
    """The learning rate, or its upper limit where it adapts: falls linearly over the training."""
    share = iteration / config.iterations
    return config.learning_rate + share * (config.final_learning_rate - config.learning_rate)


def initial_state(env: VelocityEnv, networks: PPONetworks, config: PpoConfig, seed: int) -> TrainState:
    """The state before the first iteration."""
    key, env_key, actor_key, critic_key = jax.random.split(jax.random.PRNGKey(seed), 4)
    keys = jax.random.split(env_key, config.environments)
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
    env: VelocityEnv, networks: PPONetworks, config: PpoConfig
) -> Callable[[TrainState], tuple[TrainState, dict[str, jax.Array], jax.Array]]:
    """The function from a state to the next: roll out, learn, normalise.

    It returns the new state, scalar metrics, and some of the observations that the actor saw.
    """
    optimizer = make_optimizer(config)
    make_policy = make_inference_fn(networks)
    loss = partial(
        compute_ppo_loss,
        ppo_network=networks,
        entropy_cost=config.entropy,
        discounting=config.discount,
        gae_lambda=config.gae_lambda,
        clipping_epsilon=config.clip,
    )

    def environment_step(carry: tuple, key: jax.Array, policy: Callable) -> tuple[tuple, tuple]:
        env_state, observation = carry
        action, policy_extras = policy(observation, key)
        with jax.default_matmul_precision("highest"):
            next_state, step = jax.vmap(env.step)(env_state, action)
            done = jnp.maximum(step.terminated, step.truncated)
            restarted = jax.vmap(env.reset)(next_state.key, next_state.level)
        carry = _select(done, restarted, (next_state, step.observation))
        transition = Transition(
            observation=observation,
            action=action,
            reward=step.reward,
            discount=1.0 - done,
            next_observation=carry[1],
            extras={"policy_extras": policy_extras, "state_extras": {"truncation": step.truncated}},
        )
        ended = {"done": done, "length": done * next_state.steps}
        return carry, (transition._replace(next_observation=None), step.metrics | ended, step.reward)

    def minibatch(carry: tuple, data: Transition, normalizer: Any, limit: jax.Array) -> tuple[tuple, dict]:
        params, optimizer_state, key = carry
        key, loss_key = jax.random.split(key)
        gradient, metrics = jax.grad(loss, has_aux=True)(params, normalizer, data, loss_key)
        updates, optimizer_state = optimizer.update(gradient, optimizer_state, params)
        metrics["gradient_norm"] = optax.global_norm(gradient)
        if config.desired_kl is not None:
            optimizer_state, _ = adaptive_kl_learning_rate(
                optimizer_state, metrics["kl_mean"], config.desired_kl, LEAST_LEARNING_RATE, limit
            )
        metrics["learning_rate"] = _learning_rate(optimizer_state)
        return (optax.apply_updates(params, updates), optimizer_state, key), metrics

    def one_pass(
        carry: tuple, _: None, data: Transition, normalizer: Any, limit: jax.Array
    ) -> tuple[tuple, dict]:
        params, optimizer_state, key = carry
        key, shuffle_key = jax.random.split(key)
        order = jax.random.permutation(shuffle_key, config.environments)
        batches = jax.tree.map(lambda x: x[order].reshape((config.minibatches, -1, *x.shape[1:])), data)
        return jax.lax.scan(
            partial(minibatch, normalizer=normalizer, limit=limit), (params, optimizer_state, key), batches
        )

    def iteration(state: TrainState) -> tuple[TrainState, dict[str, jax.Array], jax.Array]:
        key, rollout_key, learn_key = jax.random.split(state.key, 3)
        policy = make_policy((state.normalizer, state.params.policy))
        level = env.level(state.iteration * float(config.steps_per_iteration))
        (env_state, observation), (rollout, metrics, reward) = jax.lax.scan(
            partial(environment_step, policy=policy),
            (env.at_level(state.env, level), state.observation),
            jax.random.split(rollout_key, config.unroll),
        )
        # brax's loss wants (environment, time); of the next observations it reads the last one only.
        data = jax.tree.map(lambda x: jnp.swapaxes(x, 0, 1), rollout)
        data = data._replace(next_observation=jax.tree.map(lambda x: x[:, None], observation))
        limit = learning_rate_limit(state.iteration, config)
        rate = limit if config.desired_kl is None else jnp.minimum(_learning_rate(state.optimizer), limit)
        (params, optimizer_state, _), losses = jax.lax.scan(
            partial(one_pass, data=data, normalizer=state.normalizer, limit=limit),
            (state.params, _with_learning_rate(state.optimizer, rate), learn_key),
            None,
            length=config.passes,
        )
        # Updated after learning, so that the behaviour's log-probabilities stay comparable.
        normalizer = running_statistics.update(state.normalizer, rollout.observation, std_min_value=LEAST_STD)
        done = jnp.maximum(metrics.pop("done").sum(), 1.0)
        length = metrics.pop("length").sum() / done
        scalars = {name: jnp.mean(value) for name, value in metrics.items()}
        scalars |= {f"learning/{name}": jnp.mean(value) for name, value in losses.items()}
        scalars |= {"episode/length_s": length * env.period_s, "reward/total": reward.mean() / env.period_s}
        seen = rollout.observation["state"]
        kept = seen[-1, :LOGGED_OBSERVATIONS]
        if kept.shape[0] < LOGGED_OBSERVATIONS:
            kept = seen.reshape((-1, seen.shape[-1]))[-LOGGED_OBSERVATIONS:]
        next_state = TrainState(
            params, optimizer_state, normalizer, env_state, observation, key, state.iteration + 1
        )
        return next_state, scalars, kept

    return iteration


def _learning_rate(optimizer_state: Any) -> jax.Array:
    return optimizer_state[-1].hyperparams["learning_rate"]


def _with_learning_rate(optimizer_state: Any, rate: jax.Array) -> Any:
    adam = optimizer_state[-1]
    changed = adam._replace(hyperparams={**adam.hyperparams, "learning_rate": rate})
    return (*optimizer_state[:-1], changed)


def _select(condition: jax.Array, yes: Any, no: Any) -> Any:
    """`yes` where the condition (environments,) holds, else `no`, leaf by leaf."""

    def choose(a: jax.Array, b: jax.Array) -> jax.Array:
        return jnp.where(condition.reshape((-1,) + (1,) * (a.ndim - 1)) > 0, a, b)

    return jax.tree.map(choose, yes, no)
