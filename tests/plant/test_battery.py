"""A simulated pack: the motors discharge it, and its voltage acts on them."""

import numpy as np
import pytest
from changed_robots import described
from plant_bodies import body_of

from footfall import Robot, UserError
from footfall.plant.battery import SimulatedBattery
from footfall.plant.motor_ends.motor_end import DEFAULT_SUPPLY
from footfall.robots.battery import Battery


class Motors:
    """Motors that record their supply voltage."""

    enabled = np.ones(12, bool)
    share = 1.0
    supply = DEFAULT_SUPPLY

    def sag(self, share: float) -> None:
        self.share *= share


def test_energy_drawn_is_charge_lost_and_the_voltage_falls_with_load_and_charge(go1: Robot) -> None:
    battery = Battery(10, 1.0, 0.2)
    motors = Motors()
    pack = SimulatedBattery(go1, battery, motors, 1.0, 0.001)  # type: ignore[arg-type]
    at_rest_v = pack.voltage_v
    torque, speed = np.full(12, 5.0), np.full(12, 2.0)
    watts = float((torque * speed + go1.copper_loss * torque**2).sum())
    given_j = 0.0
    for _ in range(5000):
        pack.add(torque, speed, speed)
        given_j += (pack.voltage_v + pack.current_a * battery.internal_resistance_ohm) * pack.current_a * 1e-3
    assert pack.voltage_v * pack.current_a == pytest.approx(watts)
    assert pack.voltage_v < at_rest_v - 0.2 * pack.current_a
    assert motors.share == pytest.approx(pack.voltage_v / battery.nominal_v)
    assert motors.supply == pytest.approx((pack.voltage_v, pack.current_a / 12))
    spent = 1.0 - pack.charge
    # Above half of its charge the voltage exceeds the nominal one, so a joule takes less charge.
    assert 0.85 * given_j < spent * 3600.0 * battery.capacity_wh < given_j


def test_a_drawn_charge_is_that_of_the_simulated_pack(go1: Robot) -> None:
    """A robot without a pack is refused by name."""
    pack = Battery(8, 230.0, 0.1)
    robot = described(go1, battery=pack)
    drawn = {"battery_charge": np.array(0.3)}
    simulated = body_of(robot, sample=drawn)
    assert simulated.battery is not None
    assert simulated.battery.charge == pytest.approx(0.3)
    with pytest.raises(UserError, match="battery_charge"):
        body_of(go1, sample=drawn)
