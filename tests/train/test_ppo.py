"""One PPO update and its mirror images, on an environment of a few numbers instead of a robot."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import number_environment
import numpy as np
import pytest
from number_environment import COUNTING, COUNTING_NETWORKS, REWARD, SIZES, CountingEnvironment
from ppo_on_numbers import CONFIG, KL_ROUNDING, NETWORKS, begun, environment, first_state, learnt, rolled_out

from footfall.envs.symmetry import EnvironmentMirror
from footfall.robots.symmetry import Mirror
from footfall.train.brax import ppo, rollout
from footfall.train.brax.state import TrainState
from footfall.train.brax.symmetry import mirror_half, mirrored

pytestmark = pytest.mark.usefixtures("number_steps")


def test_an_episode_is_bootstrapped_with_the_critics_value_unless_it_ended_by_a_fall() -> None:
    """The critic's loss is a quarter of the squared error of its value, the same for all observations.

    The target is the reward and the discounted next value, after a fall the reward alone, and at the time
    limit the critic's own value.
    """
    for ends, next_value, reward in (
        ({}, CONFIG.gamma, REWARD), ({"fallen": CONFIG.num_envs}, 0.0, REWARD),
        ({"timed_out": CONFIG.num_envs}, 1.0, 0.0),
    ):  # fmt: skip
        state, rollout = begun(**ends)
        seen = environment().observation
        value = float(NETWORKS.value_network.apply(state.normalizer, state.params.value, seen)[0])
        _, losses = learnt(state, rollout)
        error = reward + next_value * value - value
        assert losses["v_loss"][0, 0] == pytest.approx(0.25 * error**2, rel=1e-4, abs=1e-9)


class TestLearningRate:
    def rates(self, moved: float, start: float, limit: float, **settings: Any) -> np.ndarray:
        """Learning rates after each mini-batch, for an actor this far from its behaviour."""
        config = replace(CONFIG, learning_rate=limit, final_learning_rate=limit, **settings)
        state, rollout = begun()
        policy = rollout.extras["policy_extras"]
        loc, scale = policy["distribution_params"]
        policy = policy | {"distribution_params": (loc + moved, scale)}
        rollout = rollout._replace(extras=rollout.extras | {"policy_extras": policy})
        state = state._replace(optimizer=ppo.with_learning_rate(state.optimizer, jnp.float32(start)))
        return learnt(state, rollout, config)[1]["learning_rate"].ravel()

    def test_an_actor_that_moves_too_far_is_slowed_down_and_a_rate_never_exceeds_the_limit(self) -> None:
        target = {"desired_kl": 0.01, "num_learning_epochs": 3}
        assert self.rates(3.0, 1e-3, 1.0, **target) == pytest.approx(1e-3 / 1.5 ** np.arange(1, 4), rel=1e-5)
        assert self.rates(1e-2, 1e-7, 1.2e-7, **target) == pytest.approx(1.2e-7)

    def test_without_a_target_the_rate_is_the_limit(self) -> None:
        assert self.rates(0.0, 0.5, 1e-3) == pytest.approx(1e-3)


def test_a_long_gradient_is_clipped() -> None:
    """Adam's first step does not depend on the gradient's length, but Adam's moments do."""
    state, rollout = begun(fallen=CONFIG.num_envs)
    optimizer, losses = learnt(state, rollout, replace(CONFIG, max_grad_norm=0.01))
    first_moment = jnp.sqrt(sum(jnp.sum(x**2) for x in jax.tree.leaves(optimizer[-1].inner_state[0].mu)))
    assert losses["gradient_norm"][0, 0] > 0.01  # as it was
    assert float(first_moment) == pytest.approx(0.1 * 0.01, rel=1e-3)  # Adam keeps a tenth of each gradient


def test_four_epochs_of_three_mini_batches(counting: TrainState, monkeypatch: pytest.MonkeyPatch) -> None:
    """The loss shows its arguments and is equally steep everywhere.

    Each epoch learns once from each environment, in an order of its own. Each of Adam's twelve steps along
    the constant gradient is as long as its rate.
    """
    given: dict[str, Any] = {}

    def loss(params: Any, _: Any, data: Any, key: jax.Array, **settings: Any) -> tuple[Any, dict]:
        given.update(settings)
        shown = {"reward": data.reward, "following": data.next_observation["state"][:, -1, 0], "key": key}
        total = 1e-4 * sum(jnp.sum(leaf) for leaf in jax.tree.leaves(params))
        return total, {"kl_mean": jnp.float32(0.0), **shown}

    monkeypatch.setattr(ppo, "compute_ppo_loss", loss)
    env: Any = CountingEnvironment()
    keys = jax.random.split(jax.random.PRNGKey(1), COUNTING.num_steps_per_env)
    (_, last), (transitions, _) = rollout.roll_out(env, COUNTING_NETWORKS, COUNTING, counting, keys)
    learner = ppo.Ppo(COUNTING_NETWORKS, COUNTING)
    params, _, losses = learner.update(counting, transitions, last, jax.random.PRNGKey(2))
    numbers = {"entropy_cost": 0.017, "discounting": 0.91, "gae_lambda": 0.82, "clipping_epsilon": 0.13}
    assert given == {"ppo_network": COUNTING_NETWORKS} | numbers

    seen = np.asarray(losses["reward"])
    assert seen.shape == (4, 3, 2, 3)  # epoch, mini-batch, environment, time
    np.testing.assert_array_equal(seen - seen[..., :1], np.broadcast_to([0, 1, 2], seen.shape))
    order = (seen[..., 0].reshape(4, -1) - 1) / 10
    assert [sorted(each) for each in order.tolist()] == [list(range(6))] * 4
    assert len({tuple(each) for each in order.tolist()}) > 1
    following = np.asarray(losses["following"]).reshape(4, -1)
    np.testing.assert_allclose(following, (np.asarray(counting.env) + 3)[order.astype(int)], rtol=1e-6)
    assert len(np.unique(np.asarray(losses["key"]).reshape(12, -1), axis=0)) == 12

    for before, after in zip(*map(jax.tree.leaves, (counting.params, params)), strict=True):
        np.testing.assert_allclose(after - before, np.full(before.shape, -12 * 2e-3), rtol=2e-3)
    np.testing.assert_allclose(losses["learning_rate"], np.full((4, 3), 2e-3))


# The mirror image of a vector swaps its first two components; the action also changes its sign.
FIRST_TWO = np.array([1, 0])
SWAP = EnvironmentMirror(
    {"state": Mirror(np.array([1, 0, 2]), np.ones(3)), "privileged_state": Mirror(FIRST_TWO, np.ones(2))},
    Mirror(FIRST_TWO, -np.ones(2)),
)


def test_images_have_mirrored_observations_and_do_not_count_as_a_change_of_the_policy() -> None:
    """The actor's action for a mirrored observation is not the mirror image of its action."""
    env = environment()
    env.observation = {
        name: jnp.arange(1.0, size + 1) + 0 * env.observation[name] for name, size in SIZES.items()
    }
    state = number_environment.with_scaled_actor(first_state(env))
    rollout = rolled_out(env, state)
    still = replace(CONFIG, learning_rate=1e-12, final_learning_rate=0.0, num_learning_epochs=3)
    _, losses = learnt(state, rollout, still, SWAP)
    assert losses["kl_mean"] == pytest.approx(0.0, abs=KL_ROUNDING)

    data = jax.tree.map(lambda x: jnp.swapaxes(x, 0, 1), rollout)
    following = {name: 10.0 + value[:, -1:] for name, value in data.observation.items()}
    behaviour = (state.normalizer, state.params.policy)
    image = mirrored(data._replace(next_observation=following), SWAP, NETWORKS, behaviour)
    for name, source in (("state", [1, 0, 2]), ("privileged_state", [1, 0])):
        np.testing.assert_allclose(image.observation[name], data.observation[name][..., source])
        np.testing.assert_allclose(image.next_observation[name], following[name][..., source])
    extras, original = (each.extras["policy_extras"] for each in (image, data))
    np.testing.assert_allclose(extras["raw_action"], -original["raw_action"][..., ::-1])
    np.testing.assert_array_equal(extras["log_prob"], original["log_prob"])
    distribution = NETWORKS.policy_network.apply(*behaviour, image.observation)
    for found, expected in zip(extras["distribution_params"], distribution, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_half_of_the_environments_are_replaced_by_their_images() -> None:
    columns = jnp.array([3, 1, 0, 2])
    drawn = np.stack([mirror_half(columns, jax.random.PRNGKey(seed)) for seed in range(64)])
    np.testing.assert_array_equal(drawn % 4, np.tile(columns, (64, 1)))
    assert set((drawn // 4).ravel()) == {0, 1}
    assert np.all(np.abs((drawn // 4).mean(axis=0) - 0.5) < 0.2)
