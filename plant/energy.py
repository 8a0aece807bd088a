"""Power of the motors from torque and speed."""

from typing import NamedTuple

import numpy as np

from footfall.robots.description import Robot

BLOCK = 64  # steps that are added up at once


class Power(NamedTuple):
    """Mean power of all motors together over some time, W."""

    electrical: float  # shaft power and copper loss
    mechanical: float  # shaft power
    positive: float  # shaft power of each motor where it is positive


class EnergyMeter:
    """Collects torque and speed of each physics step; adds them up in blocks."""

    def __init__(self, robot: Robot) -> None:
        self._loss = robot.copper_loss
        self._joints = len(robot.joint_names)
        self._steps: list[np.ndarray] = []  # torque, velocity before and velocity after, of each step
        self._clear()

    def add(self, torque: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
        """One physics step: motor torque at the joint, N m, joint velocity before and after it, rad/s; (n,).

        The arrays must not change afterwards.

        Power uses the mean velocity: with the velocity before the step alone, damping would create power.
        """
        self._steps += (torque, before, after)
        if len(self._steps) >= 3 * BLOCK:
            self._add_up()

    def take(self) -> Power:
        """Mean power since the last call. The copper loss of a motor is R (torque / (gear ratio kt))^2."""
        self._add_up()
        steps = max(self._count, 1)
        mechanical, copper, positive = self._mechanical / steps, self._copper / steps, self._positive / steps
        self._clear()
        return Power(mechanical + copper, mechanical, positive)

    def _clear(self) -> None:
        self._count = 0
        self._mechanical = self._copper = self._positive = 0.0  # sums over the steps, W

    def _add_up(self) -> None:
        if not self._steps:
            return
        rows = np.concatenate(self._steps).reshape(-1, 3, self._joints)
        self._count += len(rows)
        self._steps.clear()
        torque = rows[:, 0]
        shaft = torque * (0.5 * (rows[:, 1] + rows[:, 2]))
        self._mechanical += float(np.add.reduce(shaft, axis=None))
        self._copper += float(np.add.reduce(torque * torque @ self._loss))
        self._positive += float(np.add.reduce(np.maximum(shaft, 0.0), axis=None))
