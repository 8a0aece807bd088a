"""Rollouts: the actor in a batch of environments."""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
from brax.training.agents.ppo.networks import PPONetworks, make_inference_fn
from brax.training.types import Transition

from footfall.envs.batch import step_batch
from footfall.envs.environment import Environment
from footfall.envs.state import State
from footfall.train.brax.networks import hidden_in_bfloat16
from footfall.train.brax.state import TrainState
from footfall.train.config import PpoConfig

Episodes = tuple[State, dict[str, jax.Array]]  # environment states, and the observations for the next actions


def roll_out(
    env: Environment,
    networks: PPONetworks,
    config: PpoConfig,
    state: TrainState,
    keys: jax.Array,
    summarise: Callable[[dict[str, jax.Array]], Any] = lambda metrics: metrics,
) -> tuple[Episodes, tuple[Transition, Any]]:
    """Act for one control step per key.

    Args:
        env: the environment.
        networks: actor and critic.
        config: the trainer's settings.
        state: the training's state.
        keys: one for each control step.
        summarise: returns what to keep of a control step's metrics, arrays (environment,).

    Returns:
        The episodes to continue with; transitions (time, environment, ...), and each control step's summary.
    """
    parameters = state.params.policy
    if config.bfloat16:  # once, not in each control step
        parameters = hidden_in_bfloat16(parameters, len(config.actor_hidden_dims))
    policy = make_inference_fn(networks)((state.normalizer, parameters))
    level = env.level(state.iteration * float(config.steps_per_iteration))
    episodes = (env.at_level(state.env, level), state.observation)
    return jax.lax.scan(partial(_control_step, env, policy, summarise), episodes, keys)


def _control_step(
    env: Environment, policy: Callable, summarise: Callable, episodes: Episodes, key: jax.Array
) -> tuple[Episodes, tuple[Transition, Any]]:
    env_state, observation = episodes
    action, policy_extras = policy(observation, key)
    env_state, next_observation, step = step_batch(env, env_state, action)
    transition = Transition(
        observation=observation,
        action=action,
        reward=step.reward,
        discount=1.0 - step.metrics["done"],
        next_observation=None,  # the loss reads only the last one, an argument of `Ppo.update`
        extras={"policy_extras": policy_extras, "state_extras": {"truncation": step.truncated}},
    )
    return (env_state, next_observation), (transition, summarise(step.metrics))
