"""The actor's and the critic's networks."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from brax.training.acme import running_statistics
from brax.training.agents.ppo.networks import PPONetworks
from number_environment import ACTIONS, COUNTING, SIZES, with_scaled_actor
from number_environment import COUNTING_NETWORKS as NETWORKS

from footfall.train.brax.networks import actor_means_function, dense_layers, make_networks, trained_actor
from footfall.train.brax.state import TrainState


def outputs(networks: PPONetworks, state: TrainState, seen: Any) -> tuple[Any, Any]:
    """The actor's action and the critic's value."""
    value = networks.value_network.apply(state.normalizer, state.params.value, seen)
    return networks.policy_network.apply(state.normalizer, state.params.policy, seen)[0], value


def shown(factor: float = 1.0) -> dict[str, jax.Array]:
    """Random observations; the privileged one is multiplied by a factor."""
    seen = {name: jax.random.normal(jax.random.key(size), (50, size)) for name, size in SIZES.items()}
    return seen | {"privileged_state": factor * seen["privileged_state"]}


def test_only_the_critic_uses_the_privileged_observation(counting: TrainState) -> None:
    (action, value), (same, other) = (outputs(NETWORKS, counting, shown(factor)) for factor in (1.0, 3.0))
    assert not np.allclose(value, other)
    np.testing.assert_array_equal(action, same)


def test_bfloat16_outputs_equal_float32_within_the_rounding_of_16_bits(counting: TrainState) -> None:
    """The sizes of the networks' inputs are no multiple of the alignment."""
    rounding = make_networks(SIZES, ACTIONS, replace(COUNTING, bfloat16=True))
    both = (outputs(networks, with_scaled_actor(counting), shown()) for networks in (rounding, NETWORKS))
    for rounded, exact in zip(*both, strict=True):
        assert rounded.dtype == jnp.float32
        assert not np.array_equal(rounded, exact)
        assert jnp.linalg.norm(rounded - exact) < 0.02 * jnp.linalg.norm(exact)


class TestActor:
    def test_an_exported_actor_is_the_network_that_was_trained(self, counting: TrainState) -> None:
        policy = jax.tree.map(lambda x: 1.5 * x, counting.params.policy)
        seen = {name: 2.0 + 3.0 * each for name, each in shown().items()}
        normalizer = running_statistics.update(counting.normalizer, seen)
        actor = trained_actor(actor_means_function(NETWORKS), normalizer, policy)
        assert [kernel.shape for kernel, _ in actor.layers] == [(3, 6), (6, 5), (5, 2)]
        observed = np.random.default_rng(1).normal(size=(5, 3)).astype(np.float32)
        x = (observed - actor.mean) / actor.scale
        for kernel, bias in actor.layers[:-1]:
            x = x @ kernel + bias
            x = np.where(x > 0, x, np.expm1(np.minimum(x, 0)))
        kernel, bias = actor.layers[-1]
        np.testing.assert_allclose(actor.act(observed), x @ kernel + bias, atol=1e-5)
        np.testing.assert_allclose(actor.mean, np.asarray(seen["state"]).mean(axis=0), rtol=1e-4)
        assert actor.trainer == "brax"

    def test_layers_are_in_order_though_their_names_are_not(self) -> None:
        numbers = {f"hidden_{k}": k for k in (10, 2, 0, 11, 1)} | {"mean": 99}
        layers = {name: {"kernel": np.full((1, 1), k), "bias": np.full(1, -k)} for name, k in numbers.items()}
        found = dense_layers({"params": layers | {"log_std": np.ones(1)}})
        assert [int(kernel[0, 0]) for kernel, _ in found] == [0, 1, 2, 10, 11, 99]
        assert [int(bias[0]) for _, bias in found] == [0, -1, -2, -10, -11, -99]
        assert all(part.dtype == np.float32 for layer in found for part in layer)
