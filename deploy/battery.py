"""The battery: its charge from voltage and current, and the share of speed and torque that it allows.

Voltage alone misjudges a pack under load, and counting current alone drifts. Both are combined by a Kalman
filter of one state, the charge. The voltage at rest is the measured one plus the internal resistance's drop.
Where the curve is flat, or the current large, the voltage counts for little.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from footfall.common.config import require_between
from footfall.robots.battery import Battery
from footfall.robots.description import Robot


@dataclass(frozen=True)
class BatteryLimits:
    """When a low battery limits the robot and ends the run, and how far its readings are trusted."""

    low_charge: float = 0.2  # below which speed and torque are limited
    empty_charge: float = 0.08  # at which the run ends
    low_cell_v: float = 0.2  # above an empty cell's voltage, under load: likewise for cells that sag
    least_share: float = 0.6  # of speed and torque, just before the run ends
    off_cell_v: float = 0.3  # by which a cell's voltage may contradict charge and current
    smooth_s: float = 1.0  # time constant of both voltages: a step's peak of current is no fault
    period_s: float = 0.05  # between two looks
    voltage_error_v: float = 0.02  # of a cell, in the reading and in the curve: standard deviation
    resistance_error: float = 0.3  # share by which the internal resistance is unknown: likewise
    current_error: float = 0.15  # share by which the current is: likewise
    error_s: float = 10.0  # for which such an error stays the same

    def __post_init__(self) -> None:
        require_between(self, 0.0, 1.0, "empty_charge", "low_charge", "resistance_error", "current_error")
        require_between(self, 0.001, 5.0, "low_cell_v", "off_cell_v", "voltage_error_v")
        require_between(self, 0.1, 1.0, "least_share")
        require_between(self, 0.01, 600.0, "smooth_s", "error_s")
        require_between(self, 0.002, 10.0, "period_s")
        if self.low_charge <= self.empty_charge:
            raise ValueError(
                f"low_charge {self.low_charge:g} must be above empty_charge {self.empty_charge:g}"
            )


class BatteryState(NamedTuple):
    """The battery at a moment; NaN where nothing is known."""

    charge: float = math.nan  # share of the capacity, 0 to 1
    charge_error: float = math.nan  # its standard deviation
    voltage_v: float = math.nan  # at the motors, under load
    current_a: float = math.nan  # drawn; negative while motors feed back
    allowed: float = 1.0  # share of the ranges of commands and of the motors' torque
    fault: str = ""  # why the run has to end, in one line

    @property
    def known(self) -> bool:
        """Whether there is a claim about the charge."""
        return not math.isnan(self.charge)


NO_BATTERY = BatteryState()


class BatteryMonitor:
    """The state of a declared battery, from what the motors report."""

    def __init__(self, robot: Robot, battery: Battery, limits: BatteryLimits) -> None:
        """Nothing is known before a motor has reported a voltage."""
        self._battery, self._limits, self._loss = battery, limits, robot.copper_loss
        self._next_us: float = -math.inf
        self._last_us = 0
        self._smooth_v = math.nan  # voltage under load
        self._off_v = 0.0  # smoothed difference to what charge and current explain
        self.state = NO_BATTERY

    def look(self, now_us: int, voltage: np.ndarray, current: np.ndarray, joints: np.ndarray) -> bool:
        """Take in what motors report, if it is time; returns whether it was.

        Args:
            now_us: the loop's time.
            voltage: (n,) at the motors' supply, V; NaN where not reported.
            current: (n,) drawn from it, A; NaN where not reported: it follows from torque and speed.
            joints: (3, n) position rad, velocity rad/s, torque N m.
        """
        if now_us < self._next_us:
            return False
        self._next_us = now_us + self._limits.period_s * 1e6
        heard = voltage[np.isfinite(voltage)]
        if heard.size:
            elapsed_s = (now_us - self._last_us) * 1e-6
            self.state = self._state(elapsed_s, float(np.median(heard)), self._drawn(current, joints))
            self._last_us = now_us
        return True

    def _drawn(self, current: np.ndarray, joints: np.ndarray) -> float:
        """Current from the pack, A."""
        _, velocity, torque = joints
        power_w = torque * velocity + self._loss * torque**2
        of_motors = np.where(np.isfinite(current), current, power_w / self._battery.nominal_v)
        return float(of_motors.sum()) + self._battery.idle_w / self._battery.nominal_v

    def _state(self, elapsed_s: float, voltage_v: float, current_a: float) -> BatteryState:
        battery, limits = self._battery, self._limits
        drop_v = battery.internal_resistance_ohm * current_a
        measured = battery.charge_at(voltage_v + drop_v)
        error_v = math.hypot(battery.cells * limits.voltage_error_v, limits.resistance_error * drop_v)
        if self.state.known:
            spent = current_a * elapsed_s / battery.capacity_c
            charge, error = self.state.charge - spent, self.state.charge_error
            error += limits.current_error * abs(spent)
            of_measured = error_v / battery.volts_per_charge(charge)
            of_measured *= math.sqrt(limits.error_s / max(elapsed_s, limits.period_s))
            gain = error**2 / (error**2 + of_measured**2)
            charge, error = charge + gain * (measured - charge), math.sqrt(1.0 - gain) * error
            new = min(1.0, elapsed_s / limits.smooth_s)
        else:
            charge, error = measured, error_v / battery.volts_per_charge(measured)
            self._smooth_v, new = voltage_v, 0.0
        charge = min(max(charge, 0.0), 1.0)
        self._smooth_v += new * (voltage_v - self._smooth_v)
        self._off_v += new * (voltage_v + drop_v - battery.open_circuit_v(charge) - self._off_v)
        reserve = self._reserve(charge)
        return BatteryState(
            charge,
            error,
            voltage_v,
            current_a,
            limits.least_share + (1.0 - limits.least_share) * reserve,
            self._fault(charge, reserve),
        )

    def _reserve(self, charge: float) -> float:
        """1 where nothing is limited, 0 where the run ends."""
        limits, battery = self._limits, self._battery
        by_charge = (charge - limits.empty_charge) / (limits.low_charge - limits.empty_charge)
        by_voltage = (self._smooth_v - battery.empty_v) / (battery.cells * limits.low_cell_v)
        return min(max(min(by_charge, by_voltage), 0.0), 1.0)

    def _fault(self, charge: float, reserve: float) -> str:
        if abs(self._off_v) > self._battery.cells * self._limits.off_cell_v:
            return f"the battery's voltage is {self._off_v:+.1f} V off what its charge and current explain"
        if reserve > 0.0:
            return ""
        return f"the battery is empty: {charge:.0%} of its charge, {self._smooth_v:.1f} V under load"


def battery_monitor(robot: Robot, limits: BatteryLimits) -> BatteryMonitor | None:
    """A monitor of the battery that the robot declares; None if it declares none."""
    declared = robot.description.battery
    return None if declared is None else BatteryMonitor(robot, declared, limits)
