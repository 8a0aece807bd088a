"""States of simulated motors that are on and without errors unless said otherwise."""

import numpy as np

from footfall.plant.motor_ends.motor_end import Report


def report(
    values: np.ndarray,
    error: np.ndarray | int = 0,
    temperature_c: int = 30,
    on: np.ndarray | bool = True,
) -> Report:
    """Of motors with position rad, velocity rad/s and torque N m (3, k)."""
    k = values.shape[1]
    return Report(values, np.full(k, error, np.uint64), np.full(k, on, bool), temperature_c)
