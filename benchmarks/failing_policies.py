"""Policies that fail when the process receives SIGUSR1, for `socketcan.py`."""

import signal
import time

import numpy as np

from footfall.plant.standing import HoldDefaultPose
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot


class _FailsOnSignal(HoldDefaultPose):
    """Holds the default pose until the signal, then returns the command of `wrong`."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self._good = True
        signal.signal(signal.SIGUSR1, self._fail)

    def _fail(self, *_: object) -> None:
        self._good = False

    def act(self, inputs: PolicyInput) -> JointCommand:
        command = super().act(inputs)
        return command if self._good else self.wrong(command)

    def wrong(self, command: JointCommand) -> JointCommand:
        """The wrong command that replaces this command after the signal."""
        raise NotImplementedError


class NotANumber(_FailsOnSignal):
    """Returns NaN as stiffness."""

    def wrong(self, command: JointCommand) -> JointCommand:
        return command._replace(kp=np.full_like(command.kp, np.nan))


class Hung(_FailsOnSignal):
    """Never returns."""

    def wrong(self, command: JointCommand) -> JointCommand:
        while True:
            time.sleep(60.0)
