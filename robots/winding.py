"""Temperature of a motor's winding, and the current limit that falls with it.

One mass of heat capacity C, heated by the copper loss R I^2, cools through a thermal resistance R_th:

    C T' = R I^2 - (T - T_ambient) / R_th.

For a constant current, T approaches T_ambient + R_th R I^2 exponentially, with time constant R_th C.
The winding's own resistance R is constant here.
"""

from typing import Any, NamedTuple

from footfall.common.arrays import library
from footfall.robots.actuator import Motor

Array = Any  # a NumPy or a JAX array

AMBIENT_C = 25.0


class Winding(NamedTuple):
    """Thermal parameters of the motors: arrays that broadcast to (..., n).

    Without a thermal model `heating` is 0; without derating `derating_end` is infinite.
    """

    ambient: Array  # degrees Celsius
    start_rise: Array  # K above ambient, initially
    heating: Array  # K/(N m)^2, final rise under a constant motor torque at the joint, over its square
    cooling: Array  # 1/s, inverse of the time constant
    derating_end: Array  # degrees Celsius at which the motor has no torque left; infinite: no derating
    derating_span: Array  # K, width of the range below `derating_end` in which the current limit falls

    @property
    def start_c(self) -> Array:
        """Temperature before an episode, degrees Celsius."""
        return self.ambient + self.start_rise


def warmed(temperature_c: Array, squared_torque: Array, winding: Winding | None, elapsed_s: float) -> Array:
    """Temperatures after a time of constant power, degrees Celsius, (..., n).

    Args:
        temperature_c: initial temperatures, degrees Celsius.
        squared_torque: mean square of the motor torque at the joint, (N m)^2.
        winding: the parameters; None for motors without a thermal model, whose temperature does not change.
        elapsed_s: the time.
    """
    if winding is None:
        return temperature_c
    xp = temperature_c.__array_namespace__()
    settled = winding.ambient + winding.heating * squared_torque
    return settled + (temperature_c - settled) * xp.exp(-elapsed_s * winding.cooling)


def torque_share(temperature_c: Array, winding: Winding) -> Array:
    """Share of the peak torque left at these temperatures, (..., n), 0 to 1; 1 for NaN."""
    share = (winding.derating_end - temperature_c) / winding.derating_span
    xp = library(share)
    return xp.maximum(xp.fmin(share, 1.0), 0.0)


def at_temperature(motor: Motor, temperature_c: Array, winding: Winding | None) -> Motor:
    """The motor with its current limit at this temperature; unchanged without a thermal model."""
    if winding is None:
        return motor
    return motor._replace(peak_torque=torque_share(temperature_c, winding) * motor.peak_torque)
