"""A simulated battery: it sags under load, and the motors' electrical energy discharges it."""

import numpy as np

from footfall.plant.energy import EnergyMeter
from footfall.plant.motors import SimulatedMotors
from footfall.robots.battery import Battery, voltage_under_load
from footfall.robots.description import Robot

UPDATE_S = 0.01


class SimulatedBattery:
    """A pack. `charge`, `resistance_ohm` and `voltage_error_v` may be set to inject faults."""

    def __init__(
        self, robot: Robot, battery: Battery, motors: SimulatedMotors, charge: float, step_s: float
    ) -> None:
        """A pack at rest.

        Args:
            robot: the robot, for the motors' losses.
            battery: declared battery.
            motors: the motors, which get its voltage and report it.
            charge: initial charge, 0 to 1.
            step_s: the physics step.
        """
        self._battery, self._motors, self._meter = battery, motors, EnergyMeter(robot)
        self._update_steps = max(1, round(UPDATE_S / step_s))
        self._period_s, self._steps = self._update_steps * step_s, 0
        self.charge = charge
        self.resistance_ohm = battery.internal_resistance_ohm
        self.voltage_error_v = 0.0  # error of the reported voltage
        self.voltage_v, self.current_a = battery.nominal_v, 0.0
        self._load(battery.idle_w)

    def add(self, torque: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
        """Add the energy of one physics step, with the arguments of `EnergyMeter.add`."""
        self._meter.add(torque, before, after)
        self._steps += 1
        if self._steps % self._update_steps == 0:
            self._load(self._meter.take().electrical + self._battery.idle_w)
            discharged = self.current_a * self._period_s / self._battery.capacity_c
            self.charge = min(max(self.charge - discharged, 0.0), 1.0)

    def _load(self, power_w: float) -> None:
        """Draw electrical power: set voltage, current and the motors' supply."""
        before_v, battery, motors = self.voltage_v, self._battery, self._motors
        open_v = battery.open_circuit_v(self.charge)
        self.voltage_v = float(voltage_under_load(open_v, self.resistance_ohm, power_w))
        self.current_a = power_w / self.voltage_v
        motor_current_a = (self.current_a - battery.idle_w / self.voltage_v) / len(motors.enabled)
        motors.supply = self.voltage_v + self.voltage_error_v, motor_current_a
        motors.sag(self.voltage_v / before_v)
