"""A battery in training: its voltage sags with the motors' power and weakens them."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from changed_robots import described
from go1_smoke import IN_C, ROBOT

from footfall.common.errors import UserError
from footfall.domain_rand.distributions import Distribution
from footfall.domain_rand.randomisation import Randomisation
from footfall.envs.locomotion import LocomotionEnv
from footfall.robots.battery import Battery

PACK = Battery(8, 230.0, 0.05, idle_w=20.0)
POWERED = described(ROBOT, battery=PACK)
DRAWN = Randomisation(battery_charge=Distribution(0.2, 0.4))
CONFIG = replace(IN_C, randomisation=DRAWN)


def test_the_voltage_satisfies_the_packs_equations_and_scales_the_next_torque_speed_line() -> None:
    env = LocomotionEnv(POWERED, CONFIG)
    state = env.reset(jax.random.PRNGKey(0))[0]
    charge = float(state.sample["battery_charge"])
    assert 0.2 <= charge <= 0.4
    state = state._replace(goals=state.goals + 0.2)
    after, trace = env.simulate(state)
    speed = np.concatenate([state.qvel[None], trace.qvel])[:, env.scene.dofs]
    shaft = (trace.torque * 0.5 * (speed[:-1] + speed[1:])).sum(axis=-1)
    power_w = float((shaft + (ROBOT.copper_loss * trace.torque**2).sum(axis=-1)).mean()) + PACK.idle_w
    volts = float(after.supply) * PACK.nominal_v
    lost_v = PACK.open_circuit_v(charge) - volts
    assert lost_v > 0.2
    assert volts * lost_v / PACK.internal_resistance_ohm == pytest.approx(power_w, rel=1e-3)
    motor = env.actuation.drive(jnp.zeros((1, 12)), after.sample, after.supply).motor
    np.testing.assert_allclose(motor.stall_torque, ROBOT.motor.stall_torque * after.supply, rtol=1e-6)
    np.testing.assert_allclose(motor.no_load_speed, ROBOT.motor.no_load_speed * after.supply, rtol=1e-6)
    assert env.restart(after)[0].supply > after.supply


def test_without_a_drawn_charge_the_supply_is_nominal() -> None:
    env = LocomotionEnv(POWERED, replace(CONFIG, randomisation=Randomisation()))
    assert env.reset(jax.random.PRNGKey(0))[0].supply is None


def test_a_charge_is_refused_for_a_robot_without_a_battery() -> None:
    with pytest.raises(UserError, match="battery_charge"):
        LocomotionEnv(ROBOT, CONFIG)
