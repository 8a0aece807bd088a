"""The environment: resets, delays, falls, divergence, and rewards by name."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from go1_smoke import IN_C, ROBOT

from footfall.domain_rand.randomisation import load_randomisation
from footfall.envs.config import CurriculumConfig
from footfall.envs.delays import delayed_readings
from footfall.envs.locomotion import LocomotionEnv
from footfall.robots.model import training_model


def make(**changes: object) -> LocomotionEnv:
    return LocomotionEnv(ROBOT, replace(IN_C, **changes))


def curriculum(of: str, start: float) -> CurriculumConfig:
    return CurriculumConfig("linear", of, settings={"start": start})


@pytest.fixture(scope="module")
def env() -> LocomotionEnv:
    return make(randomisation=load_randomisation(), gait=IN_C.gait)


@pytest.fixture(scope="module")
def step(env: LocomotionEnv):
    return jax.jit(env.step)


@pytest.fixture(scope="module")
def reset(env: LocomotionEnv):
    return jax.jit(env.reset)


class TestReset:
    def test_a_reset_draws_command_body_pose_timers_and_clock(self, reset) -> None:
        one, two = reset(jax.random.PRNGKey(1))[0], reset(jax.random.PRNGKey(2))[0]
        for field in ("qpos", "qvel", "phase", "history", "recent_readings"):
            assert not np.array_equal(getattr(one, field), getattr(two, field)), field
        for field, value in one.sample.items():
            assert not np.array_equal(value, two.sample[field]), field
        for field, value in one.fields.items():
            assert not np.array_equal(value, two.fields[field]), field

    def test_the_same_key_gives_the_same_episode(self, reset) -> None:
        one, two = reset(jax.random.PRNGKey(3)), reset(jax.random.PRNGKey(3))
        assert all(np.array_equal(a, b) for a, b in zip(*map(jax.tree.leaves, (one, two)), strict=True))


class TestStep:
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
    @pytest.mark.parametrize(("delay_s", "expected"), [(0.0, 7.0), (0.005, 6.0), (0.0075, 5.5), (1.0, 0.0)])
    def test_readings_are_interpolated_between_physics_steps(self, delay_s, expected) -> None:
        trail = jnp.arange(8.0)[:, None]
        assert float(delayed_readings(trail, jnp.float32(delay_s), 0.005)[0]) == pytest.approx(expected)
