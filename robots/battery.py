"""A robot's battery as declared in `robot.yaml`: a pack of equal cells in series."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from footfall.common.config import read_yaml, require_between, require_not_negative, require_positive

CHEMISTRIES = Path(__file__).with_name("batteries.yaml")
MAX_CELLS = 300

Number = Any  # a float, or a NumPy or a JAX array


def voltage_under_load(open_v: Number, resistance_ohm: float, power_w: Number) -> Number:
    """Voltage of a pack that delivers a power, V: V = E - R I and P = V I.

    Above the pack's largest power, E²/4R, it is the voltage at that power, E/2.
    """
    squared = open_v**2 - 4.0 * resistance_ohm * power_w
    return (open_v + (squared * (squared > 0.0)) ** 0.5) / 2.0


@dataclass(frozen=True)
class Battery:
    """A pack. Charge is a share of the capacity, 0 to 1."""

    cells: int  # in series
    capacity_wh: float
    internal_resistance_ohm: float  # of the whole pack, with its leads
    chemistry: str = "lithium_ion"  # names a curve in batteries.yaml
    voltage_curve: tuple[tuple[float, float], ...] = ()  # (charge, V of one cell); (): the chemistry's
    idle_w: float = 0.0  # power of everything except the motors

    def __post_init__(self) -> None:
        require_between(self, 1, MAX_CELLS, "cells")
        require_positive(self, "capacity_wh")
        require_not_negative(self, "internal_resistance_ohm", "idle_w")
        charge, voltage = self._curve
        if len(charge) < 2 or charge[0] != 0.0 or charge[-1] != 1.0:
            raise ValueError("voltage_curve must begin at charge 0 and end at charge 1")
        if (np.diff(charge) <= 0.0).any() or (np.diff(voltage) <= 0.0).any() or voltage[0] <= 0.0:
            raise ValueError("voltage_curve must rise in charge and voltage, from a voltage above 0")

    @cached_property
    def _curve(self) -> tuple[np.ndarray, np.ndarray]:
        """Shares of charge, and the open-circuit voltage of the pack at each, V."""
        points = self.voltage_curve
        if not points:
            known = read_yaml(CHEMISTRIES)
            if self.chemistry not in known:
                raise ValueError(f"no chemistry '{self.chemistry}': there are {', '.join(known)}")
            points = known[self.chemistry]
        charge, voltage = np.array(points, dtype=float).T
        return charge, self.cells * voltage

    @property
    def curve(self) -> tuple[np.ndarray, np.ndarray]:
        """Shares of charge, rising, and the pack's voltage without load at each, V."""
        return self._curve

    def open_circuit_v(self, charge: float) -> float:
        """Voltage of the pack without load, V."""
        return float(np.interp(charge, *self._curve))

    def charge_at(self, open_circuit_v: float) -> float:
        """Charge at which the pack has this voltage without load; 0 or 1 beyond the curve."""
        charge, voltage = self._curve
        return float(np.interp(open_circuit_v, voltage, charge))

    def volts_per_charge(self, charge: float) -> float:
        """Slope of the open-circuit voltage, V per unit of charge."""
        shares, voltage = self._curve
        at = min(max(int(np.searchsorted(shares, charge)), 1), len(shares) - 1)
        return float((voltage[at] - voltage[at - 1]) / (shares[at] - shares[at - 1]))

    @property
    def empty_v(self) -> float:
        """Voltage of the empty pack without load, V."""
        return float(self._curve[1][0])

    @cached_property
    def nominal_v(self) -> float:
        """Mean voltage over a discharge without load, V."""
        charge, voltage = self._curve
        return float(np.trapezoid(voltage, charge))

    @property
    def capacity_c(self) -> float:
        """Charge of the full pack, coulomb."""
        return 3600.0 * self.capacity_wh / self.nominal_v
