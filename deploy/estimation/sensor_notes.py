"""Notes on force sensors of feet that the estimator does not use."""

import numpy as np

from footfall.robots.description import Robot

UNTRUSTED = (
    "the force sensor of {} is silent or contradicts the motors: its contact is estimated from torques"
)


class SensorNotes:
    """Collects one note for each force sensor that is not trusted.

    Args:
        robot: robot with feet.
        trial_s: time after a reset in which sensors are still on trial.

    Attributes:
        notes: one line each, without repetition.
    """

    def __init__(self, robot: Robot, trial_s: float) -> None:
        self._feet, self._trial_s = [foot.name for foot in robot.description.feet], trial_s
        self._noted = np.zeros(len(self._feet), bool)
        self.notes: list[str] = []
        self.reset()

    def reset(self) -> None:
        """Start the trial again; notes are kept."""
        self._elapsed_s = 0.0

    def update(self, untrusted: np.ndarray, dt_s: float) -> None:
        """Add notes on sensors that are not trusted, (legs,) bool, `dt_s` after the last call."""
        self._elapsed_s += dt_s
        if self._elapsed_s <= self._trial_s:
            return
        for foot in np.flatnonzero(untrusted & ~self._noted):
            self.notes.append(UNTRUSTED.format(self._feet[foot]))
        self._noted |= untrusted
