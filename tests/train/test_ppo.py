"""What PPO's iteration makes of a rollout, on an environment of a few numbers instead of a robot."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("jax")

import jax
import jax.numpy as jnp
import numpy as np
from brax.training.agents.ppo.networks import PPONetworks
from brax.training.types import Transition
from flax import linen

from footfall.envs.symmetry import EnvironmentMirror
from footfall.robots.symmetry import Mirror
from footfall.train.brax import ppo
from footfall.train.brax.networks import elu, make_networks, normalised
from footfall.train.brax.ppo import LEAST_LEARNING_RATE, TrainState, learning_rate_limit
from footfall.train.brax.symmetry import mirror_half, mirrored, with_mirror_images
from footfall.train.config import PpoConfig, load_preset

ENVIRONMENTS, UNROLL, ACTIONS = 8, 4, 2
SIZES = {"state": 3, "privileged_state": 2}
RATE = 1e-3
CONFIG: PpoConfig = replace(
    load_preset("smoke").ppo,
    num_envs=ENVIRONMENTS,
    num_steps_per_env=UNROLL,
    num_mini_batches=1,
    num_learning_epochs=1,
    learning_rate=RATE,
    final_learning_rate=RATE,
)
REWARD = 3.0
NOT_MOVED = 1e-4  # nats: brax's divergence of a distribution from itself is 1e-5 for each action


def observation(value: float = 1.0) -> dict[str, jax.Array]:
    """What every environment shows, throughout."""
    return {name: jnp.full((ENVIRONMENTS, size), value) for name, size in SIZES.items()}


class FakeEnvironment:
    """Environments that always show and give the same; some fall in each step, some run out of time."""

    period_s = 0.02
    observation_sizes, action_size = SIZES, ACTIONS

    def __init__(self, fallen: int = 0, out_of_time: int = 0, shown: float = 1.0) -> None:
        rows = np.arange(ENVIRONMENTS)
        self.fallen = jnp.float32(rows < fallen)
        self.truncated = jnp.float32((rows >= fallen) & (rows < fallen + out_of_time))
        self.shown = observation(shown)
        self.seen_steps: list[float] = []

    def reward(self, action: jax.Array) -> jax.Array:
        return jnp.full((ENVIRONMENTS,), REWARD)

    def reset(self, key: jax.Array, level: jax.Array) -> tuple[jax.Array, dict[str, jax.Array]]:
        return jnp.float32(0.0), {name: value[0] for name, value in self.shown.items()}

    def level(self, steps: jax.Array) -> jax.Array:
        return jnp.float32(steps)

    def at_level(self, state: jax.Array, level: jax.Array) -> jax.Array:
        return jnp.full_like(state, level)

    def step(self, state: jax.Array, action: jax.Array) -> tuple[jax.Array, dict[str, jax.Array], Any]:
        """One control step of all of them, in place of `step_batch`."""
        done = jnp.maximum(self.fallen, self.truncated)
        metrics = {"done": done, "length": 10.0 * done, "level": state}
        reward = self.reward(action)
        return state, self.shown, SimpleNamespace(reward=reward, truncated=self.truncated, metrics=metrics)


@pytest.fixture(autouse=True)
def _fake_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ppo, "step_batch", lambda env, state, action: env.step(state, action))


NETWORKS = make_networks(SIZES, ACTIONS, CONFIG)


def begun(env: FakeEnvironment, config: PpoConfig = CONFIG) -> TrainState:
    return ppo.initial_state(env, NETWORKS, config, 0)  # type: ignore[arg-type]


def decided(state: TrainState) -> TrainState:
    """With an actor whose actions depend on what it sees, and hardly vary."""
    policy = jax.tree.map(lambda x: 5.0 * x, state.params.policy)
    return state._replace(params=state.params.replace(policy=policy))


def rolled_out(env: FakeEnvironment, state: TrainState) -> Transition:
    keys = jax.random.split(jax.random.PRNGKey(1), UNROLL)
    return ppo.make_rollout(env, NETWORKS, CONFIG)(state, keys)[1][0]  # type: ignore[arg-type]


def learnt(
    state: TrainState,
    rollout: Transition,
    config: PpoConfig = CONFIG,
    mirror: EnvironmentMirror | None = None,
) -> tuple[Any, dict[str, np.ndarray]]:
    """The optimiser's state and the losses (pass, minibatch)."""
    learn = ppo.make_learning(NETWORKS, config, mirror=mirror)
    _, optimizer, losses = learn(state, rollout, observation(), jax.random.PRNGKey(2))
    return optimizer, {name: np.asarray(value) for name, value in losses.items()}


class TestEndsOfEpisodes:
    def value(self, state: TrainState) -> float:
        """What the critic expects; it is the same everywhere."""
        return float(NETWORKS.value_network.apply(state.normalizer, state.params.value, observation())[0])

    def test_after_a_fall_nothing_is_expected(self) -> None:
        """The critic's target is the reward alone; its loss is a quarter of the squared error."""
        env = FakeEnvironment(fallen=ENVIRONMENTS)
        state = begun(env)
        _, losses = learnt(state, rolled_out(env, state))
        assert losses["v_loss"][0, 0] == pytest.approx(0.25 * (REWARD - self.value(state)) ** 2, rel=1e-4)

    def test_a_time_out_leaves_the_expectation_as_it_is(self) -> None:
        """It says nothing of what would have followed: the target is what was expected anyhow."""
        env = FakeEnvironment(out_of_time=ENVIRONMENTS)
        state = begun(env)
        _, losses = learnt(state, rolled_out(env, state))
        assert losses["v_loss"][0, 0] == pytest.approx(0.0, abs=1e-9)

    def test_an_episode_that_goes_on_counts_on_what_follows(self) -> None:
        """With lambda 0 the target is the reward and the discounted value of the next observation."""
        env, config = FakeEnvironment(), replace(CONFIG, lam=0.0)
        state = begun(env)
        value = self.value(state)
        _, losses = learnt(state, rolled_out(env, state), config)
        error = REWARD + CONFIG.gamma * value - value
        assert losses["v_loss"][0, 0] == pytest.approx(0.25 * error**2, rel=1e-4)


class TestLearningRate:
    CONFIG = replace(
        CONFIG, desired_kl=0.01, num_learning_epochs=3, learning_rate=1.0, final_learning_rate=1.0
    )

    def rates(self, moved: float, limit: float, start: float = RATE) -> np.ndarray:
        """Rates after each of three minibatches, of an actor that has moved so far from its behaviour."""
        env = FakeEnvironment()
        config = replace(self.CONFIG, learning_rate=limit, final_learning_rate=limit)
        state = begun(env, config)
        rollout = rolled_out(env, state)
        loc, scale = rollout.extras["policy_extras"]["distribution_params"]
        rollout.extras["policy_extras"]["distribution_params"] = (loc + moved, scale)
        state = state._replace(optimizer=ppo._with_learning_rate(state.optimizer, jnp.float32(start)))
        return learnt(state, rollout, config)[1]["learning_rate"].ravel()

    def test_an_actor_that_moves_too_far_is_slowed_down(self) -> None:
        assert self.rates(moved=3.0, limit=1.0) == pytest.approx(RATE / 1.5 ** np.arange(1, 4), rel=1e-5)

    def test_but_not_to_a_halt(self) -> None:
        rates = self.rates(moved=3.0, limit=1.0, start=1.2 * LEAST_LEARNING_RATE)
        assert rates == pytest.approx(LEAST_LEARNING_RATE)

    def test_an_actor_that_hardly_moves_is_sped_up(self) -> None:
        start = 1e-7  # moves it by less than the target
        rates = self.rates(moved=1e-2, limit=1.0, start=start)
        assert rates == pytest.approx(start * 1.5 ** np.arange(1, 4), rel=1e-5)

    def test_but_never_past_the_limit(self) -> None:
        assert self.rates(moved=1e-2, limit=1.2e-7, start=1e-7) == pytest.approx(1.2e-7)

    def test_a_rate_above_the_limit_falls_to_it_at_once(self) -> None:
        assert self.rates(moved=1e-2, limit=1e-7, start=1e-3)[0] == pytest.approx(1e-7)

    def test_without_a_target_it_is_the_limit(self) -> None:
        env = FakeEnvironment()
        state = begun(env)
        state = state._replace(optimizer=ppo._with_learning_rate(state.optimizer, jnp.float32(0.5)))
        assert learnt(state, rolled_out(env, state))[1]["learning_rate"] == pytest.approx(RATE)

    def test_the_limit_falls_linearly_over_the_training(self) -> None:
        config = replace(CONFIG, learning_rate=3e-3, final_learning_rate=1e-3, total_steps=10 * 32)
        limits = [float(learning_rate_limit(jnp.float32(done), config)) for done in (0, 5, 10)]
        assert limits == pytest.approx([3e-3, 2e-3, 1e-3])


class TestIteration:
    def after(self, env: FakeEnvironment) -> tuple[TrainState, dict[str, Any], Any]:
        return ppo.make_iteration(env, NETWORKS, CONFIG)(begun(env))  # type: ignore[arg-type]

    def test_the_normaliser_moves_to_what_was_observed(self) -> None:
        state, _, _ = self.after(FakeEnvironment(shown=5.0))
        np.testing.assert_allclose(state.normalizer.mean["state"], 5.0)
        assert int(np.asarray(state.normalizer.count)) == ENVIRONMENTS * UNROLL

    def test_a_reading_that_hardly_varies_is_not_blown_up(self) -> None:
        state, _, _ = self.after(FakeEnvironment(shown=0.0))  # what it starts from: nothing deviates
        np.testing.assert_allclose(state.normalizer.std["state"], np.full(SIZES["state"], 0.02))

    def test_learning_still_sees_what_the_behaviour_saw(self) -> None:
        """The normaliser moves after learning, or the actor would look far from its own behaviour."""
        env = FakeEnvironment(shown=5.0)
        iterate = ppo.make_iteration(env, NETWORKS, CONFIG)  # type: ignore[arg-type]
        _, metrics, _ = iterate(decided(begun(env)))
        assert float(metrics["learning/kl_mean"]) == pytest.approx(0.0, abs=NOT_MOVED)

    def test_metrics_are_of_episodes_that_ended_and_rewards_of_a_second(self) -> None:
        _, metrics, _ = self.after(FakeEnvironment(fallen=2, out_of_time=1))
        assert float(metrics["episode/length_s"]) == pytest.approx(10 * 0.02)
        assert float(metrics["reward/total"]) == pytest.approx(REWARD / 0.02)

    def test_environments_are_at_the_level_of_the_steps_done(self) -> None:
        env = FakeEnvironment()
        state = begun(env)._replace(iteration=jnp.int32(3))
        _, metrics, _ = ppo.make_iteration(env, NETWORKS, CONFIG)(state)  # type: ignore[arg-type]
        assert float(metrics["level"]) == 3 * ENVIRONMENTS * UNROLL

    def test_each_iteration_draws_anew(self) -> None:
        env = FakeEnvironment()
        iterate = ppo.make_iteration(env, NETWORKS, CONFIG)  # type: ignore[arg-type]
        first, _, _ = iterate(begun(env))
        assert int(first.iteration) == 1
        keys = [ppo.iteration_keys(state, CONFIG) for state in (begun(env), first)]
        assert not np.array_equal(keys[0][1], keys[1][1])
        assert not np.array_equal(keys[0][2], keys[1][2])


class Reaching(FakeEnvironment):
    """Rewards actions by how near they are to one."""

    TARGET = jnp.array([0.5, -0.3])

    def reward(self, action: jax.Array) -> jax.Array:
        return -jnp.sum((action - self.TARGET) ** 2, axis=-1)


def test_it_learns_to_do_what_is_rewarded() -> None:
    """An actor that begins at zero ends where the reward is largest, and becomes surer of it."""
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
    env = Reaching()
    env.shown = {name: jnp.ones((environments, size)) for name, size in SIZES.items()}
    env.fallen = env.truncated = jnp.zeros(environments)
    iterate = jax.jit(ppo.make_iteration(env, NETWORKS, config))  # type: ignore[arg-type]
    state = begun(env, config)
    for _ in range(iterations):
        state, _, _ = iterate(state)
    mean, std = NETWORKS.policy_network.apply(state.normalizer, state.params.policy, env.shown)
    np.testing.assert_allclose(mean[0], Reaching.TARGET, atol=0.1)
    assert float(jnp.max(std)) < CONFIG.init_noise_std


def test_every_control_step_acts_with_noise_of_its_own() -> None:
    env = FakeEnvironment()
    _, keys, _ = ppo.iteration_keys(begun(env), CONFIG)
    actions = np.asarray(rolled_out(env, begun(env)).action)
    assert len(np.unique(keys, axis=0)) == UNROLL
    assert len(np.unique(actions.reshape(-1, ACTIONS), axis=0)) == UNROLL * ENVIRONMENTS


def test_a_gradient_is_shortened_to_its_limit() -> None:
    """Adam's first step would hide it: it is the same for any length. Its moments do not."""
    env = FakeEnvironment(fallen=ENVIRONMENTS)
    state = begun(env)
    optimizer, losses = learnt(state, rolled_out(env, state), replace(CONFIG, max_grad_norm=0.01))
    first_moment = jnp.sqrt(sum(jnp.sum(x**2) for x in jax.tree.leaves(optimizer[-1].inner_state[0].mu)))
    assert losses["gradient_norm"][0, 0] > 0.01  # as it was
    assert float(first_moment) == pytest.approx(0.1 * 0.01, rel=1e-3)  # Adam keeps a tenth of each gradient


def test_the_critic_sees_what_the_actor_does_not() -> None:
    env = FakeEnvironment()
    state = begun(env)
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


class TestMirror:
    """Of each vector the first two components change places; the action changes its sign besides."""

    SWAP = EnvironmentMirror(
        {
            "state": Mirror(np.array([1, 0, 2]), np.ones(3)),
            "privileged_state": Mirror(np.array([1, 0]), np.ones(2)),
        },
        Mirror(np.array([1, 0]), -np.ones(2)),
    )

    def begun(self) -> tuple[TrainState, Transition]:
        """An actor that answers a mirrored observation with anything but the mirror image."""
        env = FakeEnvironment()
        env.shown = {name: jnp.arange(1.0, size + 1) + 0 * env.shown[name] for name, size in SIZES.items()}
        state = decided(begun(env))
        return state, rolled_out(env, state)

    def test_a_mirrored_policy_that_has_not_changed_has_not_moved(self) -> None:
        state, rollout = self.begun()
        still = replace(CONFIG, learning_rate=1e-12, final_learning_rate=0.0, num_learning_epochs=3)
        _, losses = learnt(state, rollout, still, self.SWAP)
        assert losses["kl_mean"] == pytest.approx(0.0, abs=NOT_MOVED)

    def test_what_follows_is_mirrored_as_what_was_seen_is(self) -> None:
        state, rollout = self.begun()
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

    def test_images_stand_after_the_environments_in_each_step(self) -> None:
        state, rollout = self.begun()
        data = rollout._replace(next_observation={n: x[-1:] for n, x in rollout.observation.items()})
        behaviour = (state.normalizer, state.params.policy)
        both = with_mirror_images(data, self.SWAP, NETWORKS, behaviour)
        images = mirrored(data, self.SWAP, NETWORKS, behaviour)
        for part, expected in ((slice(None, ENVIRONMENTS), data), (slice(ENVIRONMENTS, None), images)):
            found = jax.tree.map(lambda x, part=part: x[:, part], both)
            jax.tree.map(np.testing.assert_array_equal, found, expected)

    def test_half_of_the_environments_are_replaced_by_their_images(self) -> None:
        columns = jnp.array([3, 1, 0, 2])
        drawn = np.stack([mirror_half(columns, jax.random.PRNGKey(seed)) for seed in range(64)])
        np.testing.assert_array_equal(drawn % 4, np.tile(columns, (64, 1)))
        assert set((drawn // 4).ravel()) == {0, 1}
        assert ((drawn // 4).mean(axis=0) > 0.3).all()
        assert ((drawn // 4).mean(axis=0) < 0.7).all()

    def test_each_pass_learns_from_other_images(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def loss(params: Any, _: Any, data: Transition, key: jax.Array, **__: Any) -> tuple[Any, dict]:
            seen = {"seen": data.observation["state"][:, 0, 0], "kl_mean": jnp.float32(0.0)}
            return sum(jnp.sum(leaf) for leaf in jax.tree.leaves(params)), seen

        state, rollout = self.begun()
        monkeypatch.setattr(ppo, "compute_ppo_loss", loss)
        _, losses = learnt(state, rollout, replace(CONFIG, num_learning_epochs=8), self.SWAP)
        image = losses["seen"][:, 0] == 2.0  # (pass, environment); 1 in what was rolled out
        assert len(np.unique(image, axis=0)) > 4
        assert 16 < image.sum() < 48  # of 64


def test_learning_reads_columns_of_the_rollout() -> None:
    """Vectors and numbers, of one step and of several."""
    columns = jnp.array([5, 0, 3])
    for shape in ((4, 6, 3), (4, 6), (1, 6, 2)):
        x = jnp.arange(np.prod(shape)).reshape(shape)
        np.testing.assert_array_equal(ppo._columns(x, columns), x[:, columns])


def test_learning_normalises_as_the_behaviour_did() -> None:
    """Or an actor that has not changed would look far from its own behaviour."""
    env = FakeEnvironment(shown=5.0)
    state = decided(begun(env))
    shift = state.normalizer.replace(
        mean=jax.tree.map(lambda x: x + 3.0, state.normalizer.mean),
        std=jax.tree.map(lambda x: 0.5 * x, state.normalizer.std),
    )
    state = state._replace(normalizer=shift)
    _, losses = learnt(state, rolled_out(env, state), replace(CONFIG, learning_rate=1e-12))
    assert losses["kl_mean"][0, 0] == pytest.approx(0.0, abs=NOT_MOVED)


def test_elu_and_its_gradient_are_flax_own() -> None:
    x = jnp.array([-30.0, -2.0, -1e-3, -0.0, 0.0, 1e-3, 2.0, 30.0])
    np.testing.assert_allclose(elu(x), linen.elu(x), atol=1e-6)
    slope, expected = (jax.vmap(jax.grad(function))(x) for function in (elu, linen.elu))
    np.testing.assert_allclose(slope, expected, atol=1e-6)
    assert np.isnan(elu(jnp.nan))


class TestBfloat16:
    """Networks whose inputs are no multiple of the alignment; all else is as in float32."""

    CONFIG = replace(CONFIG, bfloat16=True)
    NETWORKS = make_networks(SIZES, ACTIONS, CONFIG)

    def outputs(self, networks: PPONetworks, state: TrainState, seen: Any) -> tuple[Any, Any]:
        value = networks.value_network.apply(state.normalizer, state.params.value, seen)
        return networks.policy_network.apply(state.normalizer, state.params.policy, seen)[0], value

    def shown(self) -> dict[str, jax.Array]:
        return {n: jax.random.normal(jax.random.key(size), (50, size)) for n, size in SIZES.items()}

    def test_outputs_are_those_of_float32_but_for_16_bits_rounding(self) -> None:
        state = decided(begun(FakeEnvironment()))
        for rounded, exact in zip(
            *(self.outputs(networks, state, self.shown()) for networks in (self.NETWORKS, NETWORKS)),
            strict=True,
        ):
            assert rounded.dtype == jnp.float32
            assert not np.array_equal(rounded, exact)
            assert jnp.linalg.norm(rounded - exact) < 0.02 * jnp.linalg.norm(exact)

    def test_inputs_are_of_16_bits_in_whole_blocks(self) -> None:
        state = begun(FakeEnvironment())
        inputs = normalised(self.shown(), state.normalizer, self.CONFIG)
        assert {n: (x.shape, x.dtype) for n, x in inputs.items()} == {
            n: ((50, 8), jnp.bfloat16) for n in SIZES
        }
        assert normalised(self.shown(), state.normalizer, CONFIG)["state"].shape == (50, 3)

    def test_hidden_layers_multiply_in_16_bits(self) -> None:
        state, hidden = begun(FakeEnvironment()), len(self.CONFIG.actor_hidden_dims)
        for seen in (self.shown(), normalised(self.shown(), state.normalizer, self.CONFIG)):
            normalizer = state.normalizer if seen["state"].dtype == jnp.float32 else None
            act = partial(self.NETWORKS.policy_network.apply, normalizer)
            program = jax.make_jaxpr(act)(state.params.policy, seen)
            products = [e.outvars[0].aval for e in program.eqns if e.primitive.name == "dot_general"]
            assert [x.dtype for x in products] == [jnp.bfloat16] * hidden + [jnp.float32]

    def test_parameters_stay_in_float32(self) -> None:
        env = FakeEnvironment(fallen=2)
        state = begun(env)
        learn = ppo.make_learning(self.NETWORKS, self.CONFIG)
        params, _, losses = learn(state, rolled_out(env, state), observation(), jax.random.PRNGKey(2))
        shapes = [jax.tree.map(lambda x: (x.shape, x.dtype), tree) for tree in (params, state.params)]
        assert shapes[0] == shapes[1]
        assert all(np.isfinite(value).all() for value in losses.values())
        for before, after in zip(*map(jax.tree.leaves, (state.params.policy, params.policy)), strict=True):
            assert not np.array_equal(before, after)
