"""Standing: the default pose, levelled by the IMU."""

from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_between, require_not_negative, require_positive
from footfall.policies.controllers.settings import controller_settings
from footfall.policies.controllers.stance import level_feet, tilt_correction
from footfall.policies.policy import RATES_HZ, PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot


@dataclass(frozen=True)
class StandConfig:
    """Gains of `Stand`."""

    rate_hz: float
    kp: float  # N m/rad
    kd: float  # N m s/rad
    tilt_gain: float  # share of the measured tilt that the legs correct
    tilt_rate_gain_s: float  # s, correction per tilt rate
    max_tilt_rad: float  # largest correction
    settle_s: float  # duration of the move from the pose at reset to the default pose

    def __post_init__(self) -> None:
        require_between(self, *RATES_HZ, "rate_hz")
        require_positive(self, "kp", "settle_s")
        require_not_negative(self, "kd", "tilt_gain", "tilt_rate_gain_s", "max_tilt_rad")


class Stand:
    """Holds the default pose, and levels the base with the length of its legs."""

    name = "stand"
    needs_estimate = False
    contract = None
    notes = ()

    def __init__(self, robot: Robot, config: StandConfig | None = None) -> None:
        self._config = config or controller_settings(robot, self.name, StandConfig)
        self.rate_hz = self._config.rate_hz
        self._robot = robot
        self._legs = robot.legs
        self._start = robot.default_pose
        self._kp = np.full(len(robot.joint_names), self._config.kp)
        self._kd = np.full(len(robot.joint_names), self._config.kd)

    def reset(self, inputs: PolicyInput) -> None:
        self._start = inputs.sensed.joint_position.copy()

    def act(self, inputs: PolicyInput) -> JointCommand:
        config = self._config
        tilt = tilt_correction(inputs, config.tilt_gain, config.tilt_rate_gain_s, config.max_tilt_rad)
        feet = level_feet(self._legs.default_foot, tilt)
        goal = self._legs.scatter(self._legs.solve(feet), self._robot.default_pose)
        share = min(1.0, inputs.time_s / config.settle_s)
        position = self._start + share * (goal - self._start)
        zero = np.zeros_like(position)
        return JointCommand(position, zero, self._kp, self._kd, zero)

    def stance(self) -> np.ndarray | None:
        return np.ones(self._legs.count)
