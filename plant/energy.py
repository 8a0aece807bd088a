"""Power of the motors from torque and speed."""

from typing import NamedTuple

import numpy as np

from footfall.robots.description import Robot


class Power(NamedTuple):
    """Mean power of all motors together over some time, W."""

    electrical: float  # shaft power and copper loss
    mechanical: float  # shaft power
    positive: float  # shaft power of each motor where it is positive


class EnergyMeter:
    """Collects torque and speed of each physics step; computes the power on demand."""

    def __init__(self, robot: Robot) -> None:
        self._loss = robot.copper_loss
        self._steps: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def add(self, torque: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
        """One physics step: motor torque at the joint, N m, joint velocity before and after it, rad/s; (n,).

        The arrays must not change afterwards.

        Power uses the mean velocity: with the velocity before the step alone, damping would create power.
        """
        self._steps.append((torque, before, after))

    def take(self) -> Power:
        """Mean power since the last call. The copper loss of a motor is R (torque / (gear ratio kt))^2."""
        if not self._steps:
            return Power(0.0, 0.0, 0.0)
        rows, steps = np.array(self._steps), len(self._steps)
        self._steps.clear()
        torque = rows[:, 0]
        shaft = torque * (0.5 * (rows[:, 1] + rows[:, 2]))
        mechanical = float(np.add.reduce(shaft, axis=None)) / steps
        copper = float(np.add.reduce(torque * torque @ self._loss)) / steps
        positive = float(np.add.reduce(np.maximum(shaft, 0.0), axis=None)) / steps
        return Power(mechanical + copper, mechanical, positive)
