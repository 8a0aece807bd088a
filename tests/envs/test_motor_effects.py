"""Optional effects of motors are the same in all engines, and act only if they are enabled."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from go1_smoke import IN_C, ROBOT
from physics_parity import compare, random_arguments

from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.locomotion import LocomotionEnv
from footfall.robots.model import training_model

EFFECTS = Randomisation(
    torque_lag_s=Distribution(0.001, 0.006),
    stribeck_friction=Distribution(0.1, 0.4),
    load_friction=Distribution(0.02, 0.1),
    backlash_rad=Distribution(0.005, 0.02),
    gear_compliance=Distribution(0.001, 0.004),
)


def test_the_generated_physics_moves_as_mujoco_with_every_effect() -> None:
    model = training_model(ROBOT)
    given = random_arguments(ROBOT, model, 20, EFFECTS)
    given["motor.voltage_gain"] = np.tile([0.0, 0.9, 1.0], (20, 4))
    given["motor.duty_resistance"] = np.full((20, 12), 0.5)
    assert {"motor.stribeck", "motor.load_friction", "motor.backlash", "lag.in_mean"} <= set(given)
    assert compare(ROBOT, model, given).errors.max() < 1e-12


def test_the_lag_of_one_episode_does_not_reach_the_next() -> None:
    env = LocomotionEnv(ROBOT, replace(IN_C, randomisation=EFFECTS))
    state = jax.jit(env.reset)(jax.random.PRNGKey(3))[0]
    assert not state.lagged_torque.any()
    later = jax.jit(env.simulate)(state._replace(goals=state.goals + 0.2))[0]
    assert jnp.abs(later.lagged_torque).max() > 0.1
    assert not jax.jit(env.restart)(later)[0].lagged_torque.any()
