"""One iteration: networks, rollout, update, statistics, metrics, on an environment with few observations."""

from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import number_environment
import numpy as np
import pytest
from brax.training.acme import running_statistics
from brax.training.agents.ppo.networks import PPONetworks
from number_environment import ACTIONS, COUNTING, COUNTING_NETWORKS, SIZES, CountingEnvironment
from ppo_on_numbers import CONFIG, ENVIRONMENTS, KL_ROUNDING, NETWORKS, STEPS, environment, first_state

from footfall.train.brax import iteration, ppo, rollout
from footfall.train.brax.iteration import make_iteration
from footfall.train.brax.networks import actor_means_function, dense_layers, make_networks, trained_actor
from footfall.train.brax.state import TrainState
from footfall.train.brax.statistics import MIN_STD, add_moments, add_samples, moments
from footfall.train.stacked import StackedScalars, floats

pytestmark = pytest.mark.usefixtures("number_steps")


def test_an_iteration_updates_normaliser_metrics_and_level() -> None:
    env = environment(observed=5.0, fallen=2, timed_out=1)
    later = number_environment.with_scaled_actor(first_state(env))._replace(iteration=jnp.int32(3))
    state, metrics, _ = jax.jit(make_iteration(env, NETWORKS, CONFIG))(later)
    np.testing.assert_allclose(state.normalizer.mean["state"], 5.0)
    assert int(np.asarray(state.normalizer.count)) == ENVIRONMENTS * STEPS
    assert float(metrics["episode/length_s"]) == pytest.approx(10 * 0.02)  # of ended episodes
    assert float(metrics["reward/total"]) == pytest.approx(number_environment.REWARD / 0.02)  # per second
    assert float(metrics["level"]) == 3 * ENVIRONMENTS * STEPS
    # The normaliser is updated after learning, or the actor would seem to have changed.
    assert float(metrics["learning/kl_mean"]) == pytest.approx(0.0, abs=KL_ROUNDING)


def test_ppo_learns_the_rewarded_action() -> None:
    """An actor that begins at zero ends where the reward is largest, and its standard deviation falls."""
    env: Any = number_environment.NumberEnvironment(64)
    target = np.array([0.5, -0.3], np.float32)
    env.reward = lambda action: -jnp.sum((action - target) ** 2, axis=-1)
    sizes = {"num_envs": 64, "total_steps": 20 * 64 * STEPS, "num_mini_batches": 2, "num_learning_epochs": 2}
    config = replace(CONFIG, **sizes, learning_rate=3e-3, desired_kl=0.01)
    iterate = jax.jit(make_iteration(env, NETWORKS, config))
    state = first_state(env, config=config)
    for _ in range(20):
        state, _, _ = iterate(state)
    mean, std = NETWORKS.policy_network.apply(state.normalizer, state.params.policy, env.observation)
    np.testing.assert_allclose(mean[0], target, atol=0.1)
    assert float(jnp.max(std)) < CONFIG.init_noise_std


class TestCounting:
    """Iterations with episodes that count their steps."""

    def test_a_transition_has_observation_action_and_reward_of_one_step(self, counting: TrainState) -> None:
        keys, env = jax.random.split(jax.random.PRNGKey(1), 3), CountingEnvironment()
        rolled = rollout.roll_out(env, COUNTING_NETWORKS, COUNTING, counting, keys)
        (state, observation), (transitions, metrics) = rolled
        start, steps = np.asarray(counting.env), np.arange(1, 4)[:, None]
        ended, truncated = np.zeros((3, 6)), np.zeros((3, 6))
        ended[1, 0] = ended[2, 1] = truncated[2, 1] = 1.0
        for found, expected in (
            (transitions.observation["state"][..., 0], start + steps - 1), (state, start + 3),
            (observation["state"][:, 0], start + 3), (transitions.reward, 10.0 * np.arange(6) + steps),
            (transitions.discount, 1.0 - ended), (metrics["steps"], np.tile(steps, 6)),
            (transitions.extras["state_extras"]["truncation"], truncated),
        ):  # fmt: skip
            np.testing.assert_allclose(found, expected, rtol=1e-6)

    def test_metrics_are_means(self, counting: TrainState, monkeypatch: pytest.MonkeyPatch) -> None:
        def quickly_traced(params: Any, *_: Any, **__: Any) -> tuple[Any, dict]:
            return sum(jnp.sum(leaf) for leaf in jax.tree.leaves(params)), {"kl_mean": jnp.float32(0.0)}

        monkeypatch.setattr(ppo, "compute_ppo_loss", quickly_traced)
        for limit, logged in ((4, 4), (8, 8), (1000, 18)):
            monkeypatch.setattr(iteration, "LOGGED_OBSERVATIONS", limit)
            iterate = jax.jit(make_iteration(CountingEnvironment(), COUNTING_NETWORKS, COUNTING))
            _, metrics, observed = iterate(counting)
            assert observed.shape == (logged, 3)
            newest = np.asarray(counting.env) + 2.0
            np.testing.assert_allclose(observed[-6:, 0], newest[:limit], rtol=1e-6)
        # Mean of episodes of two and three steps.
        means = {"episode/length_s": 2.5 * 0.05, "reward/total": (25.0 + 2.0) / 0.05, "steps": 2.0}
        assert {name: float(metrics[name]) for name in means} == pytest.approx(means)
        assert not {"done", "length"} & set(metrics)


def test_scalars_keep_their_names_through_a_program_and_to_the_host() -> None:
    @jax.jit
    def program(x: jax.Array) -> StackedScalars:
        steps = jax.lax.map(lambda each: StackedScalars.of({"b": each, "a": 2.0 * each}), x)
        return steps.mean(axis=0)

    found = program(jnp.array([1.0, 2.0, 6.0]))
    assert (floats(found), set(found), float(found["b"])) == ({"a": 6.0, "b": 3.0}, {"a", "b"}, 3.0)
    assert floats({"a": jnp.float32(1.0), "b": 2}) == {"a": 1.0, "b": 2.0}  # not stacked: read separately


class TestStatistics:
    """Running statistics of the observations of 5 steps of 40 environments."""

    def test_moments_of_two_halves_give_the_statistics_of_brax_for_the_whole(self) -> None:
        rng = np.random.default_rng(0)
        ours = running_statistics.init_state({name: jnp.zeros(size) for name, size in SIZES.items()})
        theirs = ours
        for mean in (2.0, 2.5, -1.0):
            drawn = {name: rng.normal(mean, 0.5, (5, 40, size)) for name, size in SIZES.items()}
            whole = {name: jnp.asarray(each, jnp.float32) for name, each in drawn.items()}
            first = moments(ours, jax.tree.map(lambda x: x[:, :20], whole))
            second = moments(ours, jax.tree.map(lambda x: x[:, 20:], whole))
            ours = add_moments(ours, jax.tree.map(lambda a, b: (a + b) / 2, first, second), 200)
            theirs = add_samples(theirs, whole)
        jax.tree.map(lambda a, b: np.testing.assert_allclose(a, b, rtol=2e-5), ours, theirs)

    def test_an_observation_that_hardly_varies_is_not_amplified(self) -> None:
        start = running_statistics.init_state({"state": jnp.zeros(1)})
        constant = {"state": jnp.full((5, 40, 1), 9.81)}
        for after in (add_moments(start, moments(start, constant), 200), add_samples(start, constant)):
            np.testing.assert_allclose(after.mean["state"], 9.81, rtol=1e-6)
            assert float(after.std["state"][0]) == np.float32(MIN_STD)


def outputs(networks: PPONetworks, state: TrainState, observed: Any) -> tuple[Any, Any]:
    """The actor's action and the critic's value."""
    value = networks.value_network.apply(state.normalizer, state.params.value, observed)
    return networks.policy_network.apply(state.normalizer, state.params.policy, observed)[0], value


def observations(factor: float = 1.0) -> dict[str, jax.Array]:
    """Random observations; the privileged one is multiplied by a factor."""
    observed = {name: jax.random.normal(jax.random.key(size), (50, size)) for name, size in SIZES.items()}
    return observed | {"privileged_state": factor * observed["privileged_state"]}


def test_only_the_critic_uses_the_privileged_observation(counting: TrainState) -> None:
    observed = (observations(factor) for factor in (1.0, 3.0))
    (action, value), (same, other) = (outputs(COUNTING_NETWORKS, counting, each) for each in observed)
    assert not np.allclose(value, other)
    np.testing.assert_array_equal(action, same)


def test_bfloat16_outputs_equal_float32_within_the_rounding_of_16_bits(counting: TrainState) -> None:
    """The sizes of the networks' inputs are no multiple of the alignment."""
    networks = (make_networks(SIZES, ACTIONS, replace(COUNTING, bfloat16=True)), COUNTING_NETWORKS)
    both = (
        outputs(each, number_environment.with_scaled_actor(counting), observations()) for each in networks
    )
    for rounded, exact in zip(*both, strict=True):
        assert rounded.dtype == jnp.float32
        assert not np.array_equal(rounded, exact)
        assert jnp.linalg.norm(rounded - exact) < 0.02 * jnp.linalg.norm(exact)


class TestActor:
    def test_an_exported_actor_is_the_network_that_was_trained(self, counting: TrainState) -> None:
        policy = jax.tree.map(lambda x: 1.5 * x, counting.params.policy)
        observed = {name: 2.0 + 3.0 * each for name, each in observations().items()}
        normalizer = running_statistics.update(counting.normalizer, observed)
        actor = trained_actor(actor_means_function(COUNTING_NETWORKS), normalizer, policy)
        assert [kernel.shape for kernel, _ in actor.layers] == [(3, 6), (6, 5), (5, 2)]
        state = np.random.default_rng(1).normal(size=(5, 3)).astype(np.float32)
        x = (state - actor.mean) / actor.scale
        for kernel, bias in actor.layers[:-1]:
            x = jax.nn.elu(x @ kernel + bias)
        kernel, bias = actor.layers[-1]
        np.testing.assert_allclose(actor.act(state), x @ kernel + bias, atol=1e-5)
        np.testing.assert_allclose(actor.mean, np.asarray(observed["state"]).mean(axis=0), rtol=1e-4)
        assert actor.trainer == "brax"

    def test_layers_are_in_order_though_their_names_are_not(self) -> None:
        numbers = {f"hidden_{k}": k for k in (10, 2, 0, 11, 1)} | {"mean": 99}
        layers = {name: {"kernel": np.full((1, 1), k), "bias": np.full(1, -k)} for name, k in numbers.items()}
        found = dense_layers({"params": layers | {"log_std": np.ones(1)}})
        assert [int(kernel[0, 0]) for kernel, _ in found] == [0, 1, 2, 10, 11, 99]
        assert [int(bias[0]) for _, bias in found] == [0, -1, -2, -10, -11, -99]
        assert all(part.dtype == np.float32 for layer in found for part in layer)
