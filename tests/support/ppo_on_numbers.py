"""PPO on a `NumberEnvironment`: settings, networks, one rollout and one update."""

from dataclasses import replace
from functools import cache, partial
from typing import Any

import jax
import numpy as np
from brax.training.types import Transition
from number_environment import ACTIONS, SIZES, NumberEnvironment

from footfall.envs.symmetry import EnvironmentMirror
from footfall.train.brax.networks import make_networks
from footfall.train.brax.ppo import Ppo
from footfall.train.brax.rollout import roll_out
from footfall.train.brax.state import TrainState, initial_state
from footfall.train.config import PpoConfig, load_preset

KL_ROUNDING = 1e-4  # nats: brax's divergence of a distribution from itself is 1e-5 for each action
ENVIRONMENTS, STEPS = 8, 4
CONFIG: PpoConfig = replace(
    load_preset("smoke").ppo, num_envs=ENVIRONMENTS, num_steps_per_env=STEPS, num_mini_batches=1,
    num_learning_epochs=1, learning_rate=1e-3, final_learning_rate=1e-3,
    lam=0.0,  # a value's target is the reward and the discounted next value
)  # fmt: skip
NETWORKS = make_networks(SIZES, ACTIONS, CONFIG)
environment = partial(NumberEnvironment, ENVIRONMENTS)


def first_state(env: Any, config: PpoConfig = CONFIG) -> TrainState:
    """The state of a training before its first iteration."""
    return _first_state(config)._replace(observation=env.observation)


@cache
def _first_state(config: PpoConfig) -> TrainState:
    return jax.jit(lambda: initial_state(NumberEnvironment(config.num_envs), NETWORKS, config, 0))()


def rolled_out(env: Any, state: TrainState) -> Transition:
    """The transitions of one rollout."""
    return roll_out(env, NETWORKS, CONFIG, state, jax.random.split(jax.random.PRNGKey(1), STEPS))[1][0]


@cache
def begun(**ends: int) -> tuple[TrainState, Transition]:
    """The first state and rollout of a training some of whose episodes end; not to be changed."""
    env = environment(**ends)
    state = first_state(env)
    return state, rolled_out(env, state)


@cache
def plain_update(config: PpoConfig) -> Any:
    """Compiled once for all tests with these settings."""
    return jax.jit(Ppo(NETWORKS, config).update)


def learnt(
    state: TrainState,
    rollout: Transition,
    config: PpoConfig = CONFIG,
    mirror: EnvironmentMirror | None = None,
) -> tuple[Any, dict[str, np.ndarray]]:
    """The optimiser's state and the losses (epoch, mini-batch) after one update."""
    update = plain_update(config) if mirror is None else jax.jit(Ppo(NETWORKS, config, mirror=mirror).update)
    _, optimizer, losses = update(state, rollout, environment().observation, jax.random.PRNGKey(2))
    return optimizer, {name: np.asarray(value) for name, value in losses.items()}
