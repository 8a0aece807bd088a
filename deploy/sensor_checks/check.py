"""Interface of a sensor check: one small class with its state, limit, message and consequence.

To add one, write a class in a module of this folder and list it in `table.py`. The supervisor, the table of
rules in `docs/safety.md` and the settings use only these two.
"""

from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np

from footfall.deploy.modes import Mode
from footfall.deploy.sensor_checks.body_window import BodyWindow
from footfall.deploy.sensor_checks.joint_window import JointWindow
from footfall.robots.description import Robot

Settings = Any  # `SensorLimits`: each check annotates the part that it uses


class Limit(NamedTuple):
    """Largest value that passes: a setting, a property of the motor, or a share of that property."""

    setting: str = ""  # field of `SensorLimits`
    motor: str = ""  # field of `MotorType` in robot.yaml

    def of(self, robot: Robot, limits: Settings) -> np.ndarray | float:
        """Limit for a robot: (n,) for a property of the motors, otherwise one number."""
        share: float = getattr(limits, self.setting) if self.setting else 1.0
        return share * robot.motor_figures(self.motor) if self.motor else share


class SensorCheck:
    """Declarations of every sensor check."""

    quantity: ClassVar[str]  # quantity, for the table of rules
    limit: ClassVar[Limit]
    leads_to: ClassVar[Mode] = Mode.ESTOP

    def __init__(self, robot: Robot, limits: Settings, sample_s: float) -> None:
        """Create the check for one robot.

        Args:
            robot: robot to check.
            limits: `SensorLimits`, or the part of them that the check uses.
            sample_s: time between two readings in a window.
        """
        self._limits, self._n = limits, len(robot.joint_names)
        self.reset()

    def reset(self) -> None:
        """Clear all windows. A check without state has nothing to clear."""


class JointCheck(SensorCheck, ABC):
    """A check of each joint. A value above the limit, or NaN, is a fault of that joint."""

    message: ClassVar[str]  # {0} is the value, {1} the position of the joint in rad
    single_reading: ClassVar[bool] = False  # uses one reading, and runs before motors are enabled, too

    @abstractmethod
    def measure(self, window: JointWindow) -> np.ndarray:
        """Value for each joint after another window, (n,)."""


class BodyCheck(SensorCheck, ABC):
    """A check of the base. A value above the limit, or NaN, is a fault."""

    message: ClassVar[str]  # {0} is the value

    @abstractmethod
    def measure(self, window: BodyWindow) -> float:
        """Value after another window."""
