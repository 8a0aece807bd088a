"""Optional effects of motors act alike in all physics, and only where they are asked for."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from physics_parity import compare, random_arguments

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.locomotion import LocomotionEnv
from footfall.envs.physics.engines import ENGINES
from footfall.envs.physics.interface import Motion
from footfall.robots.description import load_robot
from footfall.robots.model import training_model
from footfall.train.config import load_preset

ROBOT = load_robot("go1")
EFFECTS = Randomisation(
    torque_lag_s=Distribution(0.001, 0.006),
    stribeck_friction=Distribution(0.1, 0.4),
    load_friction=Distribution(0.02, 0.1),
    backlash_rad=Distribution(0.005, 0.02),
    gear_compliance=Distribution(0.001, 0.004),
)
SMOKE = load_preset("smoke").env


def test_the_generated_physics_moves_as_mujoco_with_every_effect() -> None:
    model = training_model(ROBOT)
    given = random_arguments(ROBOT, model, 20, EFFECTS)
    given["motor.voltage_gain"] = np.tile([0.0, 0.9, 1.0], (20, 4))
    given["motor.duty_resistance"] = np.full((20, 12), 0.5)
    assert {"motor.stribeck", "motor.load_friction", "motor.backlash", "lag.in_mean"} <= set(given)
    assert compare(ROBOT, model, given).errors.max() < 1e-12


def test_a_control_step_is_the_same_generated_and_in_c() -> None:
    """And another one than without the effects: the torque's first step lacks what the lag holds back.

    MJX's compilation takes most of a minute: tests/envs/test_physics.py compares it with the effects.
    """
    moved = {}
    for name, randomisation in (("c", EFFECTS), ("none", Randomisation())):
        env = LocomotionEnv(ROBOT, replace(SMOKE, physics="c", randomisation=randomisation))
        state = jax.vmap(env.reset)(jax.random.split(jax.random.PRNGKey(0), 2))[0]
        state = state._replace(goals=state.goals + 0.2)
        targets = jax.vmap(env.actuation.targets)(state.goals, state.target, state.sample)
        drive = jax.vmap(env.actuation.drive)(targets, state.sample)
        motion = Motion(state.qpos, state.qvel, state.qacc_warmstart, state.lagged_torque)
        for engine in ("c", "generated") if name == "c" else ("c",):
            simulate = jax.jit(jax.vmap(ENGINES[engine](training_model(ROBOT, env.timestep_s), ROBOT)))
            moved[name if name == "none" else engine] = simulate(motion, drive, state.fields)
    for ours, theirs in zip(*(jax.tree.leaves(moved[name]) for name in ("generated", "c")), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-3, atol=5e-3)
    assert moved["none"][0].lagged_torque is None
    first = [np.asarray(jnp.abs(moved[name][1].torque[:, 0])).mean() for name in ("c", "none")]
    assert first[0] < 0.8 * first[1]


def test_the_lag_of_one_episode_does_not_reach_the_next() -> None:
    env = LocomotionEnv(ROBOT, replace(SMOKE, physics="c", randomisation=EFFECTS))
    state = env.reset(jax.random.PRNGKey(3))[0]
    assert not state.lagged_torque.any()
    later = env.simulate(state._replace(goals=state.goals + 0.2))[0]
    assert jnp.abs(later.lagged_torque).max() > 0.1
    assert not env.restart(later)[0].lagged_torque.any()


@pytest.mark.parametrize("effect", ["torque_lag_s", "load_friction", "backlash_rad"])
def test_a_negative_range_is_refused(effect: str) -> None:
    with pytest.raises(ValueError, match=effect):
        Randomisation(**{effect: Distribution(-0.01, 0.01)})
