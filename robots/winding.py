"""Temperature of a motor's winding, and the current limit that falls with it.

One mass of heat capacity C, heated by the copper loss R I^2, cools through a thermal resistance R_th:

    C T' = R I^2 - (T - T_ambient) / R_th.

For a constant current this is a first-order approach, with time constant R_th C, of T_ambient + R_th R I^2.
The winding's own resistance R is constant here.
"""

from typing import Any, NamedTuple

from footfall.common.arrays import library
from footfall.robots.actuator import Motor

Array = Any  # a NumPy or a JAX array

AMBIENT_C = 25.0


class Winding(NamedTuple):
    """Thermal parameters of the motors: arrays that broadcast to (..., n).

    A joint's motor without a thermal model has no heating, and one without derating ends at infinity.
    """

    ambient: Array  # degrees Celsius
    start_rise: Array  # K above ambient at first
    heating: Array  # K/(N m)^2, the rise that a constant motor torque at the joint leads to, over its square
    cooling: Array  # 1/s, over the time constant
    derating_end: Array  # degrees Celsius at which the motor has no torque left; infinite for no derating
    derating_span: Array  # K below, over which the current limit falls

    @property
    def start_c(self) -> Array:
        """Temperature before an episode, degrees Celsius."""
        return self.ambient + self.start_rise


def warmed(temperature_c: Array, squared_torque: Array, winding: Winding | None, elapsed_s: float) -> Array:
    """Temperatures after a time of constant power, degrees Celsius, (..., n).

    Args:
        temperature_c: before, degrees Celsius.
        squared_torque: mean square of the motor torque at the joint, (N m)^2.
        winding: the parameters; None for motors without a thermal model, whose temperature stays as it is.
        elapsed_s: the time.
    """
    if winding is None:
        return temperature_c
    xp = temperature_c.__array_namespace__()
    settled = winding.ambient + winding.heating * squared_torque
    return settled + (temperature_c - settled) * xp.exp(-elapsed_s * winding.cooling)


def allowed(temperature_c: Array, winding: Winding) -> Array:
    """Share of the peak torque left at these temperatures, (..., n), 0 to 1; 1 at unknown ones (NaN)."""
    share = (winding.derating_end - temperature_c) / winding.derating_span
    xp = library(share)
    return xp.maximum(xp.fmin(share, 1.0), 0.0)


def at_temperature(motor: Motor, temperature_c: Array, winding: Winding | None) -> Motor:
    """The motor with the current limit that its temperature leaves; unchanged without a thermal model."""
    if winding is None:
        return motor
    return motor._replace(peak_torque=allowed(temperature_c, winding) * motor.peak_torque)
