"""How late a controller's commands act, measured on the motors' own torques."""

import math

import numpy as np

from footfall.robots.actuator import JointCommand, Motor, limit_torque
from footfall.robots.readings import Sensed

_LONGEST_S = 0.045  # longest delay that is considered
_MEMORY_S = 0.3  # time constant of the mean squared deviations
_EVERY_S = 0.006  # between two comparisons: commands change no faster
_MARGIN = 0.8  # another age has to explain the torques this much better than the one believed in
_EXPLAINED = 0.3  # and this much better than the mean of all ages
_LEAST_NM2 = 1e-4  # mean squared deviation, about a reading's resolution


class CommandDelay:
    """Measures the delay from a reading to the moment at which the command worked out from it acts.

    A motor reports the torque of the command that it follows. The joint law gives the torque of each
    recent command; the age of the one that matches is the delay. It contains the travel on the bus, the
    motors' own delay and the age of the readings. While commands barely change, the delay keeps its value.

    Args:
        motor: the motors' limits.
        dt_s: time between two commands.
    """

    def __init__(self, motor: Motor, dt_s: float) -> None:
        self._motor, self._dt_s = motor, dt_s
        ages = 2 + math.ceil(_LONGEST_S / dt_s)
        self._every = max(1, round(_EVERY_S / dt_s))
        self._keep = math.exp(-self._every * dt_s / _MEMORY_S)
        self._sent = np.zeros((ages, 5, len(motor.peak_torque)))  # the newest first
        self._error = np.zeros(ages)  # (N m)^2, mean over the joints, decaying
        self.reset()

    def reset(self) -> None:
        """Forget an earlier episode."""
        self._error[:] = 0.0
        self._count, self.ticks = 0, 1

    def sent(self, command: JointCommand) -> None:
        """Note the command of this tick."""
        self._sent[1:] = self._sent[:-1]
        self._sent[0] = command
        self._count += 1

    def measure(self, sensed: Sensed) -> int:
        """Delay in ticks, at least 1, after the next readings."""
        if self._count >= len(self._sent) and self._count % self._every == 0:
            self._compare(sensed)
        return self.ticks

    def velocity_changes(self) -> np.ndarray:
        """Velocities (ticks, n) of commands under way, newest first, minus those of the active command."""
        if self._count <= self.ticks:
            return np.zeros((1, self._sent.shape[2]))
        return self._sent[: self.ticks, 1] - self._sent[self.ticks, 1]

    def _compare(self, sensed: Sensed) -> None:
        position, velocity, kp, kd, torque = self._sent.transpose(1, 0, 2)
        torque = torque + kp * (position - sensed.joint_position) + kd * (velocity - sensed.joint_velocity)
        deviation = limit_torque(torque, sensed.joint_velocity, self._motor) - sensed.joint_torque
        self._error *= self._keep
        self._error += (1.0 - self._keep) * np.einsum("aj,aj->a", deviation, deviation) / deviation.shape[1]
        error = self._error + _LEAST_NM2
        # A command leaves one tick after its readings were taken and shows in those one tick later still.
        best = max(1, int(error.argmin()))
        if error[best] < _MARGIN * error[self.ticks] and error[best] < _EXPLAINED * error.mean():
            self.ticks = best
