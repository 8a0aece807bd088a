"""Learning from mirror images."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from brax.training.types import Transition
from number_environment import SIZES, with_scaled_actor
from ppo_on_numbers import CONFIG, NETWORKS, NOT_MOVED, environment, first_state, learnt, rolled_out

from footfall.envs.symmetry import EnvironmentMirror
from footfall.robots.symmetry import Mirror
from footfall.train.brax.state import TrainState
from footfall.train.brax.symmetry import mirror_half, mirrored

pytestmark = pytest.mark.usefixtures("number_steps")


class TestMirror:
    """The mirror image of a vector swaps its first two components; the action also changes its sign."""

    SWAP = EnvironmentMirror(
        {
            "state": Mirror(np.array([1, 0, 2]), np.ones(3)),
            "privileged_state": Mirror(np.array([1, 0]), np.ones(2)),
        },
        Mirror(np.array([1, 0]), -np.ones(2)),
    )

    def state_and_rollout(self) -> tuple[TrainState, Transition]:
        """An actor whose action for a mirrored observation is not the mirror image."""
        env = environment()
        env.shown = {name: jnp.arange(1.0, size + 1) + 0 * env.shown[name] for name, size in SIZES.items()}
        state = with_scaled_actor(first_state(env))
        return state, rolled_out(env, state)

    def test_mirror_images_do_not_count_as_a_change_of_the_policy(self) -> None:
        state, rollout = self.state_and_rollout()
        still = replace(CONFIG, learning_rate=1e-12, final_learning_rate=0.0, num_learning_epochs=3)
        _, losses = learnt(state, rollout, still, self.SWAP)
        assert losses["kl_mean"] == pytest.approx(0.0, abs=NOT_MOVED)

    def test_the_next_observation_is_mirrored_like_the_first(self) -> None:
        state, rollout = self.state_and_rollout()
        data = jax.tree.map(lambda x: jnp.swapaxes(x, 0, 1), rollout)
        following = {name: 10.0 + value[:, -1:] for name, value in data.observation.items()}
        behaviour = (state.normalizer, state.params.policy)
        image = mirrored(data._replace(next_observation=following), self.SWAP, NETWORKS, behaviour)
        for name, source in (("state", [1, 0, 2]), ("privileged_state", [1, 0])):
            np.testing.assert_allclose(image.observation[name], data.observation[name][..., source])
            np.testing.assert_allclose(image.next_observation[name], following[name][..., source])
        extras, original = (each.extras["policy_extras"] for each in (image, data))
        np.testing.assert_allclose(extras["raw_action"], -original["raw_action"][..., ::-1])
        np.testing.assert_array_equal(extras["log_prob"], original["log_prob"])
        loc, scale = NETWORKS.policy_network.apply(*behaviour, image.observation)
        np.testing.assert_allclose(extras["distribution_params"][0], loc, atol=1e-6)
        np.testing.assert_allclose(extras["distribution_params"][1], scale, atol=1e-6)

    def test_half_of_the_environments_are_replaced_by_their_images(self) -> None:
        columns = jnp.array([3, 1, 0, 2])
        drawn = np.stack([mirror_half(columns, jax.random.PRNGKey(seed)) for seed in range(64)])
        np.testing.assert_array_equal(drawn % 4, np.tile(columns, (64, 1)))
        assert set((drawn // 4).ravel()) == {0, 1}
        assert ((drawn // 4).mean(axis=0) > 0.3).all()
        assert ((drawn // 4).mean(axis=0) < 0.7).all()
