"""Effects of lost frames, jitter and swings on an environment."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from go1_smoke import IN_C, ROBOT

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.config import EnvConfig, ObservationConfig
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.state import State

CONFIG = replace(
    IN_C, observation=(ObservationConfig("joint_position"), ObservationConfig("joint_velocity", 0.05))
)
ENVIRONMENTS, STEPS = 16, 6


def walked(config: EnvConfig, **drawn: float) -> tuple[State, np.ndarray]:
    """The last state, and the observations (steps, environments, 2n), under fixed actions."""
    ranges = {name: Distribution(value, value) for name, value in drawn.items()}
    env = LocomotionEnv(ROBOT, replace(config, randomisation=Randomisation(**ranges)))
    state, _ = jax.jit(jax.vmap(env.reset))(jax.random.split(jax.random.PRNGKey(4), ENVIRONMENTS))
    step = jax.jit(jax.vmap(env.step))
    seen = []
    for k in range(STEPS):
        action = 0.5 * jnp.sin(k + jnp.arange(12.0)) * jnp.ones((ENVIRONMENTS, 1))
        state, result = step(state, action)
        seen.append(np.asarray(result.observation["state"]))
    return state, np.array(seen)


@pytest.fixture(scope="module")
def nominal() -> tuple[State, np.ndarray]:
    return walked(CONFIG)


def test_lost_replies_change_only_the_observation(nominal: tuple[State, np.ndarray]) -> None:
    """In 0.4 of the steps, both position and velocity of a motor stay the same."""
    (before, seen), (after, fewer) = nominal, walked(CONFIG, lost_replies=0.4)
    for name in ("qpos", "goals", "command", "key"):
        np.testing.assert_array_equal(getattr(before, name), getattr(after, name))
    changed = ~np.isclose(seen, fewer, atol=1e-6)
    assert changed[..., :12].mean() == pytest.approx(0.4, abs=0.06)
    assert (changed[..., :12] == changed[..., 12:]).mean() > 0.98


def test_late_commands_change_the_motion_and_no_other_draw(nominal: tuple[State, np.ndarray]) -> None:
    before, _ = nominal
    after, _ = walked(CONFIG, action_jitter_s=0.01, lost_commands=0.2, action_swing_s=0.005)
    assert before.lateness_s is None
    assert after.lateness_s is not None
    assert after.lateness_s.shape == (ENVIRONMENTS, 3, 12)
    assert 0.0 < float(after.lateness_s[:, 0].mean()) < 0.02
    assert float(jnp.abs(after.qpos - before.qpos).max()) > 1e-3
    for name in ("command", "key", "goals"):
        np.testing.assert_array_equal(getattr(before, name), getattr(after, name))
