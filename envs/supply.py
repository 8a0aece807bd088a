"""The motors' supply in training: the battery's voltage sags with the power of the previous control step."""

import jax
import jax.numpy as jnp

from footfall.common.arrays import single
from footfall.domain_rand.randomisation import QUANTITIES, Randomisation, require_parts
from footfall.domain_rand.sample import Sample, battery_charge
from footfall.robots.battery import Battery, voltage_under_load
from footfall.robots.description import Robot


class Supply:
    """Voltage of a robot's battery over its nominal voltage. The charge is constant in an episode."""

    def __init__(self, robot: Robot, randomisation: Randomisation) -> None:
        """Raises UserError if a randomised quantity needs a part that the robot does not have."""
        self._battery: Battery | None = robot.description.battery
        self._copper_loss = single(robot.copper_loss)
        for name in QUANTITIES:
            if getattr(randomisation, name) is not None:
                require_parts(name, robot)

    def at_rest(self, sample: Sample) -> jax.Array | None:
        """Voltage share before an episode, (); None: the charge is not randomised, the supply nominal."""
        charge = battery_charge(sample)
        return None if charge is None else self._voltage_share(charge, jnp.float32(0.0))

    def under_load(self, sample: Sample, torque: jax.Array, velocity: jax.Array) -> jax.Array | None:
        """Voltage share after a control step, (); None as in `at_rest`.

        Args:
            sample: randomised quantities of the robot.
            torque: torque of the motors in each physics step, N m, (substeps, n).
            velocity: velocity of the joints before each physics step and after the last, rad/s, (substeps +
                1, n).
        """
        charge = battery_charge(sample)
        if charge is None:
            return None
        shaft_w = torque * 0.5 * (velocity[:-1] + velocity[1:])
        return self._voltage_share(
            charge, jnp.mean(jnp.sum(shaft_w + self._copper_loss * torque**2, axis=-1))
        )

    def _voltage_share(self, charge: jax.Array, motors_w: jax.Array) -> jax.Array:
        battery = self._battery
        assert battery is not None
        charges, volts = (jnp.asarray(part, dtype=jnp.float32) for part in battery.curve)
        open_v = jnp.interp(charge, charges, volts)
        power_w = motors_w + battery.idle_w
        return voltage_under_load(open_v, battery.internal_resistance_ohm, power_w) / battery.nominal_v
