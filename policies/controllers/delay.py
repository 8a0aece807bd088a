"""Delay until a controller's commands act, measured with the motors' torques."""

import math

import numpy as np

from footfall.robots.actuator import JointCommand, Motor, limit_torque
from footfall.robots.readings import Sensed

_MAX_DELAY_S = 0.045  # longest delay that is considered
_ERROR_FILTER_S = 0.3  # time constant of the mean squared deviations
_COMPARE_EVERY_S = 0.006  # between two comparisons: commands change no faster
_MARGIN = 0.8  # another delay replaces the current one only if its error is smaller by this factor
_EXPLAINED = 0.3  # ... and smaller by this factor than the mean error of all delays
_RESOLUTION_NM2 = 1e-4  # mean squared deviation due to the resolution of a reading


class CommandDelay:
    """Measures the time from a reading until the command computed from it acts.

    A motor reports the torque of the command that it executes. The joint law gives the torque of each recent
    command; the age of the matching command is the delay. It includes the bus time, the motors' delay and the
    age of the readings. While commands barely change, the delay keeps its value.

    Args:
        motor: the motors' limits.
        dt_s: time between two commands.
    """

    def __init__(self, motor: Motor, dt_s: float) -> None:
        self._motor, self._dt_s = motor, dt_s
        ages = 2 + math.ceil(_MAX_DELAY_S / dt_s)
        self._every = max(1, round(_COMPARE_EVERY_S / dt_s))
        self._decay = math.exp(-self._every * dt_s / _ERROR_FILTER_S)
        self._sent = np.zeros((ages, 5, len(motor.peak_torque)))  # newest first
        self._error = np.zeros(ages)  # (N m)^2, mean over the joints, exponentially decaying
        self.reset()

    def reset(self) -> None:
        """Start a new episode."""
        self._error[:] = 0.0
        self._count, self.ticks = 0, 1

    def record(self, command: JointCommand) -> None:
        """Record the command of this tick."""
        self._sent[1:] = self._sent[:-1]
        self._sent[0] = command
        self._count += 1

    def measure(self, sensed: Sensed) -> int:
        """Delay in ticks, at least 1, updated with the next readings."""
        if self._count >= len(self._sent) and self._count % self._every == 0:
            self._compare(sensed)
        return self.ticks

    def velocity_changes(self) -> np.ndarray:
        """Velocities (ticks, n) of commands that do not act yet, newest first, minus those of the active
        command."""
        if self._count <= self.ticks:
            return np.zeros((1, self._sent.shape[2]))
        return self._sent[: self.ticks, 1] - self._sent[self.ticks, 1]

    def _compare(self, sensed: Sensed) -> None:
        position, velocity, kp, kd, torque = self._sent.transpose(1, 0, 2)
        torque = torque + kp * (position - sensed.joint_position) + kd * (velocity - sensed.joint_velocity)
        deviation = limit_torque(torque, sensed.joint_velocity, self._motor) - sensed.joint_torque
        self._error *= self._decay
        self._error += (1.0 - self._decay) * np.einsum("aj,aj->a", deviation, deviation) / deviation.shape[1]
        error = self._error + _RESOLUTION_NM2
        # A command is sent one tick after its readings; its effect is read one tick later.
        best = max(1, int(error.argmin()))
        if error[best] < _MARGIN * error[self.ticks] and error[best] < _EXPLAINED * error.mean():
            self.ticks = best
