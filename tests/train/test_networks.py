"""The actor's and the critic's networks."""

from dataclasses import replace
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import number_environment
import numpy as np
import pytest
from brax.training.acme import running_statistics
from brax.training.agents.ppo.networks import PPONetworks
from number_environment import ACTIONS, SIZES, NumberEnvironment, with_scaled_actor
from number_environment import COUNTING as CONFIG
from number_environment import COUNTING_NETWORKS as NETWORKS

from footfall.train.brax.networks import actor_means_function, dense_layers, make_networks, trained_actor
from footfall.train.brax.state import TrainState

environment = partial(NumberEnvironment, CONFIG.num_envs)
first_state = partial(number_environment.first_state, networks=NETWORKS, config=CONFIG)


def observation() -> dict[str, jax.Array]:
    return {name: jnp.ones((CONFIG.num_envs, size)) for name, size in SIZES.items()}


pytestmark = pytest.mark.usefixtures("number_steps")


def test_only_the_critic_uses_the_privileged_observation() -> None:
    env = environment()
    state = first_state(env)
    seen = observation() | {"privileged_state": 3.0 * observation()["privileged_state"]}
    value, other = (
        NETWORKS.value_network.apply(state.normalizer, state.params.value, x) for x in (observation(), seen)
    )
    action, same = (
        NETWORKS.policy_network.apply(state.normalizer, state.params.policy, x)[0]
        for x in (observation(), seen)
    )
    assert not np.allclose(value, other)
    np.testing.assert_array_equal(action, same)


class TestBfloat16:
    """Networks whose inputs are no multiple of the alignment; all else is as in float32."""

    CONFIG = replace(CONFIG, bfloat16=True)
    NETWORKS = make_networks(SIZES, ACTIONS, CONFIG)

    def outputs(self, networks: PPONetworks, state: TrainState, seen: Any) -> tuple[Any, Any]:
        value = networks.value_network.apply(state.normalizer, state.params.value, seen)
        return networks.policy_network.apply(state.normalizer, state.params.policy, seen)[0], value

    def shown(self) -> dict[str, jax.Array]:
        return {n: jax.random.normal(jax.random.key(size), (50, size)) for n, size in SIZES.items()}

    def test_outputs_equal_float32_within_the_rounding_of_16_bits(self) -> None:
        state = with_scaled_actor(first_state(environment()))
        for rounded, exact in zip(
            *(self.outputs(networks, state, self.shown()) for networks in (self.NETWORKS, NETWORKS)),
            strict=True,
        ):
            assert rounded.dtype == jnp.float32
            assert not np.array_equal(rounded, exact)
            assert jnp.linalg.norm(rounded - exact) < 0.02 * jnp.linalg.norm(exact)


class TestActor:
    def test_an_exported_actor_is_the_network_that_was_trained(self, counting: TrainState) -> None:
        """The normaliser's statistics change the output."""
        policy = jax.tree.map(lambda x: 1.5 * x, counting.params.policy)
        rng = np.random.default_rng(1)
        shown = {name: jnp.asarray(rng.normal(2.0, 3.0, (50, size))) for name, size in SIZES.items()}
        normalizer = running_statistics.update(counting.normalizer, shown)
        actor = trained_actor(actor_means_function(NETWORKS), normalizer, policy)
        assert [kernel.shape for kernel, _ in actor.layers] == [(3, 6), (6, 5), (5, 2)]
        observed = rng.normal(size=(5, 3)).astype(np.float32)
        x = (observed - actor.mean) / actor.scale
        for kernel, bias in actor.layers[:-1]:
            x = x @ kernel + bias
            x = np.where(x > 0, x, np.expm1(np.minimum(x, 0)))
        kernel, bias = actor.layers[-1]
        np.testing.assert_allclose(actor.act(observed), x @ kernel + bias, atol=1e-5)
        np.testing.assert_allclose(actor.mean, np.asarray(shown["state"]).mean(axis=0), rtol=1e-4)
        assert actor.trainer == "brax"

    def test_layers_are_in_order_though_their_names_are_not(self) -> None:
        numbers = [10, 2, 0, 11, 1]
        layers = {f"hidden_{k}": {"kernel": np.full((1, 1), k), "bias": np.full(1, -k)} for k in numbers}
        tree = {
            "params": {"mean": {"kernel": np.full((1, 1), 99), "bias": np.zeros(1)}, "log_std": np.ones(1)}
            | layers
        }
        found = dense_layers(tree)
        assert [int(kernel[0, 0]) for kernel, _ in found] == [0, 1, 2, 10, 11, 99]
        assert [int(bias[0]) for _, bias in found] == [0, -1, -2, -10, -11, 0]
        assert all(part.dtype == np.float32 for layer in found for part in layer)
