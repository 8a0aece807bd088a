"""One PPO update, on an environment of a few numbers instead of a robot."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import number_environment
import numpy as np
import pytest
from number_environment import COUNTING, COUNTING_NETWORKS, REWARD, CountingEnvironment
from ppo_on_numbers import (
    CONFIG,
    ENVIRONMENTS,
    NETWORKS,
    RATE,
    environment,
    first_state,
    learnt,
    observation,
    rolled_out,
)

from footfall.train.brax import ppo, rollout
from footfall.train.brax.state import TrainState

pytestmark = pytest.mark.usefixtures("number_steps")


class TestEndsOfEpisodes:
    def value(self, state: TrainState) -> float:
        """The critic's value, the same for all observations."""
        return float(NETWORKS.value_network.apply(state.normalizer, state.params.value, observation())[0])

    def test_a_fall_is_not_bootstrapped(self) -> None:
        """The critic's target is the reward alone; its loss is a quarter of the squared error."""
        env = environment(fallen=ENVIRONMENTS)
        state = first_state(env)
        _, losses = learnt(state, rolled_out(env, state))
        assert losses["v_loss"][0, 0] == pytest.approx(0.25 * (REWARD - self.value(state)) ** 2, rel=1e-4)

    def test_a_time_out_is_bootstrapped_with_the_critics_value(self) -> None:
        """The target is the critic's own value."""
        env = environment(out_of_time=ENVIRONMENTS)
        state = first_state(env)
        _, losses = learnt(state, rolled_out(env, state))
        assert losses["v_loss"][0, 0] == pytest.approx(0.0, abs=1e-9)

    def test_an_unfinished_episode_is_bootstrapped(self) -> None:
        """The target is the reward and the discounted value of the next observation."""
        state = first_state(environment())
        value = self.value(state)
        _, losses = learnt(state, rolled_out(environment(), state))
        error = REWARD + CONFIG.gamma * value - value
        assert losses["v_loss"][0, 0] == pytest.approx(0.25 * error**2, rel=1e-4)


class TestLearningRate:
    CONFIG = replace(
        CONFIG, desired_kl=0.01, num_learning_epochs=3, learning_rate=1.0, final_learning_rate=1.0
    )

    def rates(self, moved: float, limit: float, start: float = RATE) -> np.ndarray:
        """Learning rates after each of three mini-batches, for an actor this far from its behaviour."""
        env = environment()
        config = replace(self.CONFIG, learning_rate=limit, final_learning_rate=limit)
        state = first_state(env, config=config)
        rollout = rolled_out(env, state)
        loc, scale = rollout.extras["policy_extras"]["distribution_params"]
        rollout.extras["policy_extras"]["distribution_params"] = (loc + moved, scale)
        state = state._replace(optimizer=ppo.with_learning_rate(state.optimizer, jnp.float32(start)))
        return learnt(state, rollout, config)[1]["learning_rate"].ravel()

    def test_an_actor_that_moves_too_far_is_slowed_down(self) -> None:
        assert self.rates(moved=3.0, limit=1.0) == pytest.approx(RATE / 1.5 ** np.arange(1, 4), rel=1e-5)

    def test_a_rate_never_exceeds_the_limit(self) -> None:
        assert self.rates(moved=1e-2, limit=1.2e-7, start=1e-7) == pytest.approx(1.2e-7)

    def test_without_a_target_the_rate_is_the_limit(self) -> None:
        env = environment()
        state = first_state(env)
        state = state._replace(optimizer=ppo.with_learning_rate(state.optimizer, jnp.float32(0.5)))
        assert learnt(state, rolled_out(env, state))[1]["learning_rate"] == pytest.approx(RATE)


def test_a_long_gradient_is_clipped() -> None:
    """Adam's first step does not depend on the gradient's length, but Adam's moments do."""
    env = environment(fallen=ENVIRONMENTS)
    state = first_state(env)
    optimizer, losses = learnt(state, rolled_out(env, state), replace(CONFIG, max_grad_norm=0.01))
    first_moment = jnp.sqrt(sum(jnp.sum(x**2) for x in jax.tree.leaves(optimizer[-1].inner_state[0].mu)))
    assert losses["gradient_norm"][0, 0] > 0.01  # as it was
    assert float(first_moment) == pytest.approx(0.1 * 0.01, rel=1e-3)  # Adam keeps a tenth of each gradient


class TestEpochs:
    """Learning with four epochs of three mini-batches.

    The loss shows its arguments and is equally steep everywhere.
    """

    @pytest.fixture(scope="class")
    @classmethod
    def learnt(cls, counting: TrainState) -> tuple[dict[str, Any], Any]:
        given: dict[str, Any] = {}

        def loss(
            params: Any, normalizer: Any, data: Any, key: jax.Array, **settings: Any
        ) -> tuple[Any, dict]:
            given.update(settings)
            following = data.next_observation["state"][:, -1, 0]
            shown = {"reward": data.reward, "following": following, "key": key}
            total = 1e-4 * sum(jnp.sum(leaf) for leaf in jax.tree.leaves(params))
            return total, {"kl_mean": jnp.float32(0.0), **shown}

        keys = jax.random.split(jax.random.PRNGKey(1), COUNTING.num_steps_per_env)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(rollout, "step_batch", number_environment.step_batch)
            patch.setattr(ppo, "compute_ppo_loss", loss)
            env: Any = CountingEnvironment()
            (_, seen), (transitions, _) = rollout.roll_out(env, COUNTING_NETWORKS, COUNTING, counting, keys)
            learner = ppo.Ppo(COUNTING_NETWORKS, COUNTING)
            return given, learner.update(counting, transitions, seen, jax.random.PRNGKey(2))

    def test_the_settings_reach_the_loss(self, learnt: tuple[dict[str, Any], Any]) -> None:
        given, _ = learnt
        assert given["ppo_network"] is COUNTING_NETWORKS
        assert {name: value for name, value in given.items() if name != "ppo_network"} == {
            "entropy_cost": 0.017,
            "discounting": 0.91,
            "gae_lambda": 0.82,
            "clipping_epsilon": 0.13,
        }

    def test_each_epoch_learns_once_from_each_environment_in_an_order_of_its_own(
        self, counting: TrainState, learnt: tuple[dict[str, Any], Any]
    ) -> None:
        _, (_, _, losses) = learnt
        seen = np.asarray(losses["reward"])
        assert seen.shape == (4, 3, 2, 3)  # epoch, mini-batch, environment, time
        np.testing.assert_array_equal(seen - seen[..., :1], np.broadcast_to([0, 1, 2], seen.shape))
        order = (seen[..., 0].reshape(4, -1) - 1) / 10
        assert [sorted(each) for each in order.tolist()] == [list(range(6))] * 4
        assert len({tuple(each) for each in order.tolist()}) > 1
        following = np.asarray(losses["following"]).reshape(4, -1)
        np.testing.assert_allclose(following, (np.asarray(counting.env) + 3)[order.astype(int)], rtol=1e-6)
        assert len(np.unique(np.asarray(losses["key"]).reshape(12, -1), axis=0)) == 12

    def test_each_step_changes_parameters_by_the_learning_rate(
        self, counting: TrainState, learnt: tuple[dict[str, Any], Any]
    ) -> None:
        """Adam's steps along a gradient that stays as it is are as long as its rate; there are twelve of
        them."""
        _, (params, _, losses) = learnt
        for before, after in zip(*map(jax.tree.leaves, (counting.params, params)), strict=True):
            np.testing.assert_allclose(after - before, np.full(before.shape, -12 * 2e-3), rtol=2e-3)
        np.testing.assert_allclose(losses["learning_rate"], np.full((4, 3), 2e-3))
