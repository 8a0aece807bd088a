"""The environment: resets, delays, falls, divergence, and rewards by name."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.noise import Noise
from footfall.domain_rand.randomisation import Randomisation, load_randomisation
from footfall.envs.config import CurriculumConfig, RewardConfig
from footfall.envs.delays import delayed_readings
from footfall.envs.locomotion import LocomotionEnv
from footfall.policies.observation import observation_size
from footfall.robots.description import load_robot
from footfall.robots.model import training_model
from footfall.train.config import load_preset

ROBOT = load_robot("go1")
SMOKE = replace(load_preset("smoke").env, physics="c")  # compiled faster


def make(**changes: object) -> LocomotionEnv:
    return LocomotionEnv(ROBOT, replace(SMOKE, **changes))


def curriculum(of: str, start: float) -> CurriculumConfig:
    return CurriculumConfig("linear", of, settings={"start": start})


@pytest.fixture(scope="module")
def env() -> LocomotionEnv:
    return make(randomisation=load_randomisation(), gait=SMOKE.gait)


@pytest.fixture(scope="module")
def step(env: LocomotionEnv):
    return jax.jit(env.step)


@pytest.fixture(scope="module")
def reset(env: LocomotionEnv):
    return jax.jit(env.reset)


class TestReset:
    def test_draws_command_body_pose_timers_and_clock_afresh(self, reset) -> None:
        one, two = reset(jax.random.PRNGKey(1))[0], reset(jax.random.PRNGKey(2))[0]
        for field in ("qpos", "qvel", "phase", "frames", "recent_readings"):
            assert not np.array_equal(getattr(one, field), getattr(two, field)), field
        for field, value in one.sample.items():
            assert not np.array_equal(value, two.sample[field]), field
        for field, value in one.fields.items():
            assert not np.array_equal(value, two.fields[field]), field

    def test_same_key_same_episode(self, reset) -> None:
        one, two = reset(jax.random.PRNGKey(3)), reset(jax.random.PRNGKey(3))
        assert all(np.array_equal(a, b) for a, b in zip(*map(jax.tree.leaves, (one, two)), strict=True))

    def test_leaves_nothing_of_the_last_episode(self, env: LocomotionEnv, reset, step) -> None:
        state, _ = reset(jax.random.PRNGKey(4))
        for _ in range(3):
            state, _ = step(state, jnp.ones(env.action_size))
        fresh, _ = reset(state.key)
        assert int(fresh.steps) == 0
        assert not np.any(fresh.actions)
        assert np.allclose(fresh.goals, ROBOT.default_pose)
        assert np.allclose(fresh.target, ROBOT.default_pose)

    def test_observation_has_the_size_of_the_contract(self, env: LocomotionEnv, reset) -> None:
        _, observation = reset(jax.random.PRNGKey(5))
        assert observation["state"].shape == (observation_size(env.contract),)
        assert env.observation_sizes == {name: seen.shape[-1] for name, seen in observation.items()}


class TestStep:
    def test_the_actor_does_not_see_the_base_velocity(self, env: LocomotionEnv, reset) -> None:
        state, _ = reset(jax.random.PRNGKey(6))
        moved, torque = state._replace(qvel=state.qvel.at[:3].add(1.0)), jnp.zeros(env.action_size)
        recent = jnp.tile(env.observer.readings(moved.qpos, moved.qvel, torque), (2 * SMOKE.substeps, 1))
        still = jnp.tile(env.observer.readings(state.qpos, state.qvel, torque), (2 * SMOKE.substeps, 1))
        u = jnp.full(env.observer.numbers, 0.7)
        seen = [env.observer.observe(*each, u)[1] for each in ((moved, recent), (state, still))]
        assert np.array_equal(*seen)

    def test_the_level_rises_with_the_steps(self) -> None:
        env = make(curriculum_steps=100)
        assert [float(env.level(jnp.float32(s))) for s in (0, 50, 200)] == [0.0, 0.5, 1.0]

    def test_the_curriculum_widens_the_randomisation_from_the_nominal_robot(self) -> None:
        env = make(curricula=(curriculum("randomisation", 0.0),), randomisation=load_randomisation())
        key = jax.random.PRNGKey(12)
        reset = jax.jit(env.reset)
        nominal, half, full = (reset(key, level)[0] for level in (0.0, 0.5, 1.0))
        assert np.allclose(nominal.sample["link_mass"], 1.0)
        assert np.allclose(nominal.fields["body_mass"], training_model(ROBOT).body_mass)
        assert float(nominal.sample["action_delay_s"]) == 0.0
        assert float(full.sample["payload_kg"]) != 0.0
        assert np.isclose(half.sample["payload_kg"], full.sample["payload_kg"] / 2)

    def test_the_curriculum_slows_the_first_command_down_too(self) -> None:
        env = make(curricula=(curriculum("commands", 0.2),))
        key = jax.random.PRNGKey(12)
        reset = jax.jit(env.reset)
        first, half, full = (reset(key, level)[0].command for level in (0.0, 0.5, 1.0))
        assert np.abs(full).max() > 0.1
        np.testing.assert_allclose(first, 0.2 * full, rtol=1e-6)
        np.testing.assert_allclose(half, 0.6 * full, rtol=1e-6)


class TestDelays:
    @pytest.mark.parametrize("longest_s", [0.006, 0.015])
    def test_delays_at_the_motors_are_distributed_as_declared(self, longest_s: float) -> None:
        """After a step of the goals from 0 to 1, the target stays at 0 for the duration of its delay."""
        env = make(randomisation=Randomisation(action_delay_s=Distribution(0.0, longest_s)))
        states, _ = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.PRNGKey(14), 4000))
        near = 0.05  # rad from the default pose, which the rate limit lets pass at once
        goals = states.goals.at[:, 0].add(near)
        targets = jax.jit(jax.vmap(env.actuation.targets))(goals, states.target, states.sample)
        lacking = 1.0 - (targets[:, :, 0] - states.target[:, None, 0]) / near
        seen = np.sort(np.asarray(lacking.sum(axis=1)) * env.timestep_s)
        np.testing.assert_allclose(seen, np.sort(states.sample["action_delay_s"]), atol=1e-6)
        even = np.linspace(0.0, longest_s, len(seen))
        assert np.abs(seen - even).max() < 0.03 * longest_s  # uniform: no step of its distribution function
        assert seen.mean() == pytest.approx(longest_s / 2, rel=0.03)

    @pytest.mark.parametrize(("delay_s", "expected"), [(0.0, 7.0), (0.005, 6.0), (0.0075, 5.5), (1.0, 0.0)])
    def test_readings_are_interpolated_between_physics_steps(self, delay_s, expected) -> None:
        trail = jnp.arange(8.0)[:, None]
        assert float(delayed_readings(trail, jnp.float32(delay_s), 0.005)[0]) == pytest.approx(expected)

    def test_a_delay_beyond_the_buffers_is_refused(self) -> None:
        with pytest.raises(UserError, match="action_delay_s"):
            make(randomisation=Randomisation(action_delay_s=Distribution(0.0, 0.5)))


def test_an_unknown_reward_is_refused_by_name() -> None:
    with pytest.raises(UserError, match="no reward 'tracking'"):
        make(rewards=(RewardConfig("tracking", 1.0),))


def test_an_encoder_bias_moves_the_joint_as_well_as_the_reading() -> None:
    """The motor holds its encoder's position, so in free fall the true joint is off by the bias."""

    def settled(bias: float) -> np.ndarray:
        env = make(randomisation=Randomisation(encoder_bias=Distribution(bias, bias)), noise=Noise())
        state, _ = jax.jit(env.reset)(jax.random.PRNGKey(13))
        still = jnp.zeros_like(state.qvel)
        state = state._replace(qpos=state.qpos.at[2].set(50.0), qvel=still, hold_steps=jnp.int32(1000))
        state = state._replace(command=jnp.zeros(3), event_steps={"push": jnp.int32(1000)})
        step = jax.jit(env.step)
        for _ in range(40):
            state, _ = step(state, jnp.zeros(env.action_size))
        return np.asarray(state.qpos[7:])

    assert settled(0.05) - settled(0.0) == pytest.approx(-0.05, abs=0.005)
