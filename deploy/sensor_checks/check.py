"""What a sensor check is: one small class with its state, its limit, its message and its consequence.

To add one, write a class in a module of this folder and list it in `table.py`. The supervisor, the table of
rules in `docs/safety.md` and the settings follow from these two places.
"""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np

from footfall.deploy.modes import Mode
from footfall.deploy.sensor_checks.body_window import BodyWindow
from footfall.deploy.sensor_checks.joint_window import JointWindow
from footfall.robots.description import Robot

Settings = Any  # `SensorLimits`: each check names the part that it reads


class Limit(NamedTuple):
    """The largest value that passes: a setting, a figure of the motor, or a share of that figure."""

    setting: str = ""  # field of `SensorLimits`
    motor: str = ""  # field of `MotorType` in robot.yaml

    def of(self, robot: Robot, limits: Settings) -> np.ndarray | float:
        """The limit of a robot: (n,) if it is a figure of the motors, else one number."""
        share: float = getattr(limits, self.setting) if self.setting else 1.0
        return share * robot.motor_figures(self.motor) if self.motor else share


class SensorCheck:
    """What all sensor checks declare."""

    looks_at: ClassVar[str]  # for the table of rules
    limit: ClassVar[Limit]
    leads_to: ClassVar[Mode] = Mode.ESTOP

    def __init__(self, robot: Robot, limits: Settings, sample_s: float) -> None:
        """A check of one robot.

        Args:
            robot: whose readings are checked.
            limits: `SensorLimits`, or the part of them that the check reads.
            sample_s: time between two readings that are added to a window.
        """
        self.reset()

    def reset(self) -> None:
        """Forget all windows. A check without state has nothing to forget."""


class JointCheck(SensorCheck, ABC):
    """A check of each joint. A value above the limit, and NaN, is a fault of that joint."""

    message: ClassVar[str]  # {0} is the value, {1} the joint's position in rad
    single_reading: ClassVar[bool] = False  # judged from one reading, also before motors are enabled

    @abstractmethod
    def measure(self, window: JointWindow) -> np.ndarray:
        """The value of each joint after one more window, (n,)."""


class BodyCheck(SensorCheck, ABC):
    """A check of the base. A value above the limit, and NaN, is a fault."""

    message: ClassVar[str]  # {0} is the value

    @abstractmethod
    def measure(self, window: BodyWindow) -> float:
        """The value after one more window."""
