"""One iteration: rollout, update, normaliser and metrics, on an environment of a few numbers."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from number_environment import (
    COUNTING,
    COUNTING_NETWORKS,
    REWARD,
    CountingEnvironment,
    NumberEnvironment,
    with_scaled_actor,
)
from ppo_on_numbers import CONFIG, ENVIRONMENTS, NETWORKS, NOT_MOVED, UNROLL, environment, first_state

from footfall.train.brax import iteration, ppo, rollout
from footfall.train.brax.iteration import make_iteration
from footfall.train.brax.state import TrainState

pytestmark = pytest.mark.usefixtures("number_steps")


def test_an_iteration_follows_observations_episodes_and_steps() -> None:
    env = environment(shown=5.0, fallen=2, out_of_time=1)
    begun_late = first_state(env)._replace(iteration=jnp.int32(3))
    state, metrics, _ = make_iteration(env, NETWORKS, CONFIG)(begun_late)
    np.testing.assert_allclose(state.normalizer.mean["state"], 5.0)
    assert int(np.asarray(state.normalizer.count)) == ENVIRONMENTS * UNROLL
    assert float(metrics["episode/length_s"]) == pytest.approx(10 * 0.02)  # of ended episodes
    assert float(metrics["reward/total"]) == pytest.approx(REWARD / 0.02)  # per second
    assert float(metrics["level"]) == 3 * ENVIRONMENTS * UNROLL


def test_the_normaliser_moves_after_learning() -> None:
    """Otherwise the actor would seem to have changed."""
    env = environment(shown=5.0)
    _, metrics, _ = make_iteration(env, NETWORKS, CONFIG)(with_scaled_actor(first_state(env)))
    assert float(metrics["learning/kl_mean"]) == pytest.approx(0.0, abs=NOT_MOVED)


class Reaching(NumberEnvironment):
    """Rewards actions near one."""

    TARGET = np.array([0.5, -0.3], np.float32)

    def reward(self, action: jax.Array) -> jax.Array:
        return -jnp.sum((action - self.TARGET) ** 2, axis=-1)


def test_ppo_learns_the_rewarded_action() -> None:
    """An actor that begins at zero ends where the reward is largest, and its standard deviation falls."""
    iterations, environments = 20, 64
    config = replace(
        CONFIG,
        num_envs=environments,
        total_steps=iterations * environments * UNROLL,
        num_mini_batches=2,
        num_learning_epochs=2,
        learning_rate=3e-3,
        desired_kl=0.01,
    )
    env = Reaching(environments)
    iterate = jax.jit(make_iteration(env, NETWORKS, config))
    state = first_state(env, config=config)
    for _ in range(iterations):
        state, _, _ = iterate(state)
    mean, std = NETWORKS.policy_network.apply(state.normalizer, state.params.policy, env.shown)
    np.testing.assert_allclose(mean[0], Reaching.TARGET, atol=0.1)
    assert float(jnp.max(std)) < CONFIG.init_noise_std


def plain_loss(params: Any, *_: Any, **__: Any) -> tuple[Any, dict]:
    """A loss that is quick to trace."""
    return sum(jnp.sum(leaf) for leaf in jax.tree.leaves(params)), {"kl_mean": jnp.float32(0.0)}


class TestCounting:
    """Iterations with episodes that count their steps."""

    def test_a_transition_has_observation_action_and_reward_of_one_step(self, counting: TrainState) -> None:
        keys, env = jax.random.split(jax.random.PRNGKey(1), 3), CountingEnvironment()
        rolled = rollout.roll_out(env, COUNTING_NETWORKS, COUNTING, counting, keys)
        (state, observation), (transitions, metrics) = rolled
        start = np.asarray(counting.env)
        np.testing.assert_allclose(
            transitions.observation["state"][..., 0], start + np.arange(3)[:, None], rtol=1e-6
        )
        np.testing.assert_allclose(observation["state"][:, 0], start + 3, rtol=1e-6)
        np.testing.assert_allclose(state, start + 3, rtol=1e-6)
        steps = np.arange(1, 3 + 1)[:, None]
        np.testing.assert_allclose(transitions.reward, 10.0 * np.arange(6) + steps)
        ended, late = np.zeros((3, 6)), np.zeros((3, 6))
        ended[1, 0] = ended[2, 1] = late[2, 1] = 1.0
        np.testing.assert_array_equal(transitions.discount, 1.0 - ended)
        np.testing.assert_array_equal(transitions.extras["state_extras"]["truncation"], late)
        np.testing.assert_array_equal(metrics["steps"], np.tile(steps, 6))

    def test_metrics_are_means(self, counting: TrainState, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(ppo, "compute_ppo_loss", plain_loss)
        monkeypatch.setattr(iteration, "LOGGED_OBSERVATIONS", 1000)
        all_of_them = jax.eval_shape(
            make_iteration(CountingEnvironment(), COUNTING_NETWORKS, COUNTING), counting
        )[2]
        assert all_of_them.shape == (18, 3)
        for limit in (4, 8):
            monkeypatch.setattr(iteration, "LOGGED_OBSERVATIONS", limit)
            _, metrics, seen = make_iteration(CountingEnvironment(), COUNTING_NETWORKS, COUNTING)(counting)
            assert seen.shape == (limit, 3)
            newest = np.asarray(counting.env) + 2.0
            np.testing.assert_allclose(seen[-6:, 0], newest[:limit], rtol=1e-6)
        # Mean of episodes of two and three steps.
        assert float(metrics["episode/length_s"]) == pytest.approx(2.5 * 0.05)
        assert float(metrics["reward/total"]) == pytest.approx((25.0 + 2.0) / 0.05)
        assert float(metrics["steps"]) == pytest.approx(2.0)
        assert not {"done", "length"} & set(metrics)
