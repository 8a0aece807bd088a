"""Policies that go wrong once SIGUSR1 comes, for a controller in a process of its own (`socketcan.py`)."""

import signal
import time

import numpy as np

from footfall.plant.standing import HoldDefaultPose
from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot


class _FailsOnSignal(HoldDefaultPose):
    """Holds the default pose until then."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self._good = True
        signal.signal(signal.SIGUSR1, self._fail)

    def _fail(self, *_: object) -> None:
        self._good = False

    def act(self, inputs: PolicyInput) -> JointCommand:
        decision = super().act(inputs)
        return decision if self._good else self.wrong(decision)

    def wrong(self, decision: JointCommand) -> JointCommand:
        """What it decides from then on."""
        raise NotImplementedError


class NotANumber(_FailsOnSignal):
    """Its stiffness is no number."""

    def wrong(self, decision: JointCommand) -> JointCommand:
        return decision._replace(kp=np.full_like(decision.kp, np.nan))


class Hung(_FailsOnSignal):
    """It never comes back."""

    def wrong(self, decision: JointCommand) -> JointCommand:
        while True:
            time.sleep(60.0)
