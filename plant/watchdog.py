"""Timeouts of simulated motors: a motor that is not addressed for too long disables itself."""

import numpy as np

from footfall.deploy.drivers.driver import Motors
from footfall.plant.motor_ends.motor_end import MotorEnd

CHECK_EVERY = 5  # physics steps


class Watchdog:
    """Counts physics steps since each motor was addressed."""

    def __init__(self, end: MotorEnd, timeout_s: float | np.ndarray, step_s: float, joints: int) -> None:
        """`timeout_s`, for all motors or for each, (joints,), applies unless a frame sets another."""
        self._end, self._timeout_s, self._step_s = end, timeout_s, step_s
        self._addressed_step = np.zeros(joints, dtype=np.int64)
        self.timed_out = np.zeros(joints, dtype=bool)  # until the motor is enabled again, or cleared
        self.read_timeouts()

    def read_timeouts(self) -> None:
        """Apply the timeouts that frames have set."""
        own = self._end.timeout_s
        self._timeout_steps = np.rint(np.where(np.isnan(own), self._timeout_s, own) / self._step_s)
        self._min_timeout_steps = self._timeout_steps.min()

    def address(self, motor: Motors, step: int) -> None:
        """Register that motors were addressed in a physics step."""
        self._addressed_step[motor] = step

    def check(self, step: int, enabled: np.ndarray) -> np.ndarray | None:
        """Note motors that time out, at every `CHECK_EVERY`-th step.

        Returns:
            Mask of the enabled motors that time out in this step, (joints,); None if none does.
        """
        addressed = self._addressed_step
        if step % CHECK_EVERY or step - addressed[addressed.argmin()] <= self._min_timeout_steps:
            return None
        newly_timed_out = enabled & (step - addressed > self._timeout_steps)
        if not newly_timed_out.any():
            return None
        self.timed_out |= newly_timed_out
        return newly_timed_out
