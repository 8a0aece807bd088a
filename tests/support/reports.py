"""Motor states as a simulated robot reports them: on and without errors by default."""

import numpy as np

from footfall.plant.motor_ends.motor_end import Report


def report(
    values: np.ndarray, error: np.ndarray | int = 0, temperature_c: int = 30, on: np.ndarray | bool = True
) -> Report:
    """`values`: positions rad, velocities rad/s and torques N m of k motors, (3, k)."""
    k = values.shape[1]
    return Report(values, np.full(k, error, np.uint64), np.full(k, on, bool), temperature_c)
