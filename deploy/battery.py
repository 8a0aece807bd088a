"""Battery: charge from voltage and current, and the share of speed and torque that it allows.

Voltage alone misjudges a pack under load, and integrated current drifts. A Kalman filter with one state, the
charge, combines both. The open-circuit voltage is the measured one plus the drop at the internal resistance.
If the curve is flat or the current is large, the voltage has little weight.
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
    """Limits at which a low battery slows the robot and ends the run, and uncertainties of its readings."""

    low_charge: float = 0.2  # charge below which speed and torque are limited
    empty_charge: float = 0.08  # charge at which the run ends
    low_cell_v: float = 0.2  # the same range as a cell's voltage under load above its empty voltage
    min_share: float = 0.6  # share of speed and torque just before the run ends
    max_cell_deviation_v: float = 0.3  # from a cell's voltage for this charge and current
    smooth_s: float = 1.0  # time constant of both voltages: a step's current peak is not a fault
    period_s: float = 0.05  # between two updates
    voltage_error_v: float = 0.02  # standard deviation of a cell's voltage, in the reading and in the curve
    resistance_error: float = 0.3  # standard deviation of the internal resistance, as a share
    current_error: float = 0.15  # standard deviation of the current, as a share
    error_s: float = 10.0  # correlation time of these errors

    def __post_init__(self) -> None:
        require_between(self, 0.0, 1.0, "empty_charge", "low_charge", "resistance_error", "current_error")
        require_between(self, 0.001, 5.0, "low_cell_v", "max_cell_deviation_v", "voltage_error_v")
        require_between(self, 0.1, 1.0, "min_share")
        require_between(self, 0.01, 600.0, "smooth_s", "error_s")
        require_between(self, 0.002, 10.0, "period_s")
        if self.low_charge <= self.empty_charge:
            raise ValueError(
                f"low_charge {self.low_charge:g} must be above empty_charge {self.empty_charge:g}"
            )


class BatteryState(NamedTuple):
    """State of the battery; NaN for unknown values."""

    charge: float = math.nan  # share of the capacity, 0 to 1
    charge_error: float = math.nan  # standard deviation of the charge
    voltage_v: float = math.nan  # at the motors, under load
    current_a: float = math.nan  # drawn current; negative while motors feed back
    allowed: float = 1.0  # share of the command ranges and of the motors' torque
    fault: str = ""  # reason to end the run, in one line

    @property
    def known(self) -> bool:
        """Whether the charge is known."""
        return not math.isnan(self.charge)


NO_BATTERY = BatteryState()


class BatteryMonitor:
    """State of a battery in robot.yaml, from the motors' reports."""

    def __init__(self, robot: Robot, battery: Battery, limits: BatteryLimits) -> None:
        """The state is unknown until a motor has reported a voltage."""
        self._battery, self._limits, self._loss = battery, limits, robot.copper_loss
        self._next_us: float = -math.inf
        self._last_us = 0
        self._smooth_v = math.nan  # voltage under load
        self._deviation_v = 0.0  # smoothed difference from the voltage for charge and current
        self.state = NO_BATTERY

    def update(self, now_us: int, voltage: np.ndarray, current: np.ndarray, joints: np.ndarray) -> bool:
        """Update the state if it is due, with the motors' reports; returns whether it was due.

        Args:
            now_us: the loop's time.
            voltage: (n,) supply voltage of each motor, V; NaN if not reported.
            current: (n,) supply current of each motor, A; if NaN, it is computed from torque and speed.
            joints: (3, n) position rad, velocity rad/s, torque N m.
        """
        if now_us < self._next_us:
            return False
        self._next_us = now_us + self._limits.period_s * 1e6
        reported = voltage[np.isfinite(voltage)]
        if reported.size:
            elapsed_s = (now_us - self._last_us) * 1e-6
            self.state = self._updated_state(
                elapsed_s, float(np.median(reported)), self._drawn_current(current, joints)
            )
            self._last_us = now_us
        return True

    def _drawn_current(self, current: np.ndarray, joints: np.ndarray) -> float:
        """Current drawn from the pack, A."""
        _, velocity, torque = joints
        power_w = torque * velocity + self._loss * torque**2
        motor_currents = np.where(np.isfinite(current), current, power_w / self._battery.nominal_v)
        return float(motor_currents.sum()) + self._battery.idle_w / self._battery.nominal_v

    def _updated_state(self, elapsed_s: float, voltage_v: float, current_a: float) -> BatteryState:
        """State after a reading, `elapsed_s` after the previous one."""
        battery, limits = self._battery, self._limits
        drop_v = battery.internal_resistance_ohm * current_a
        measured = battery.charge_at(voltage_v + drop_v)
        error_v = math.hypot(battery.cells * limits.voltage_error_v, limits.resistance_error * drop_v)
        if self.state.known:
            spent = current_a * elapsed_s / battery.capacity_c
            charge, error = self.state.charge - spent, self.state.charge_error
            error += limits.current_error * abs(spent)
            measured_error = error_v / battery.volts_per_charge(charge)
            measured_error *= math.sqrt(limits.error_s / max(elapsed_s, limits.period_s))
            gain = error**2 / (error**2 + measured_error**2)
            charge, error = charge + gain * (measured - charge), math.sqrt(1.0 - gain) * error
            weight = min(1.0, elapsed_s / limits.smooth_s)
        else:
            charge, error = measured, error_v / battery.volts_per_charge(measured)
            self._smooth_v, weight = voltage_v, 0.0
        charge = min(max(charge, 0.0), 1.0)
        self._smooth_v += weight * (voltage_v - self._smooth_v)
        self._deviation_v += weight * (
            voltage_v + drop_v - battery.open_circuit_v(charge) - self._deviation_v
        )
        reserve = self._reserve(charge)
        return BatteryState(
            charge,
            error,
            voltage_v,
            current_a,
            limits.min_share + (1.0 - limits.min_share) * reserve,
            self._fault(charge, reserve),
        )

    def _reserve(self, charge: float) -> float:
        """Reserve of the battery: 1 without limitation, 0 at the end of the run."""
        limits, battery = self._limits, self._battery
        by_charge = (charge - limits.empty_charge) / (limits.low_charge - limits.empty_charge)
        by_voltage = (self._smooth_v - battery.empty_v) / (battery.cells * limits.low_cell_v)
        return min(max(min(by_charge, by_voltage), 0.0), 1.0)

    def _fault(self, charge: float, reserve: float) -> str:
        if abs(self._deviation_v) > self._battery.cells * self._limits.max_cell_deviation_v:
            return f"the battery's voltage differs by {self._deviation_v:+.1f} V from what its charge implies"
        if reserve > 0.0:
            return ""
        return f"the battery is empty: {charge:.0%} of its charge, {self._smooth_v:.1f} V under load"


def battery_monitor(robot: Robot, limits: BatteryLimits) -> BatteryMonitor | None:
    """Monitor for the battery in robot.yaml; None without one."""
    declared = robot.description.battery
    return None if declared is None else BatteryMonitor(robot, declared, limits)
