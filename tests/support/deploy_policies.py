"""Small policies and robots for the tests of the deploy loop."""

import time
from collections.abc import Callable, Sequence

import numpy as np

from footfall import Episode, JointCommand, PolicyInput, Robot
from footfall.deploy.config import DeployConfig
from footfall.deploy.safety import SafetyConfig
from footfall.policies.contract import Contract


class Hold:
    """Holds the default pose."""

    name = "hold"
    rate_hz = 50.0
    needs_estimate = False
    contract: Contract | None = None
    notes: Sequence[str] = ()

    def __init__(self, robot: Robot) -> None:
        self._pose, self._gains = robot.default_pose, (4 * robot.kp, 2 * robot.kd)
        self._zeros = np.zeros_like(robot.default_pose)
        self.resets = 0
        self.seen: list[PolicyInput] = []

    def reset(self, inputs: PolicyInput) -> None:
        self.resets += 1

    def act(self, inputs: PolicyInput) -> JointCommand:
        self.seen.append(inputs)
        return JointCommand(self._pose, self._zeros, *self._gains, self._zeros)

    def stance(self) -> None:
        return None


class Sway(Hold):
    """Swings all joints together; a pitch rate of the base adds to it."""

    name = "sway"

    def act(self, inputs: PolicyInput) -> JointCommand:
        hold = super().act(inputs)
        depth = 0.1 * np.sin(6.0 * inputs.time_s) + 0.01 * inputs.sensed.gyro[1]
        return hold._replace(position=hold.position + depth)


class FailingPolicy(Hold):
    """Holds the pose until a time, then changes its command, or fails."""

    name = "failing"

    def __init__(self, robot: Robot, at_s: float, change: Callable[[JointCommand], JointCommand]) -> None:
        super().__init__(robot)
        self._at_s, self._change = at_s, change

    def act(self, inputs: PolicyInput) -> JointCommand:
        command = super().act(inputs)
        return self._change(command) if inputs.time_s >= self._at_s else command


def not_a_number(command: JointCommand) -> JointCommand:
    return command._replace(torque=command.torque * np.nan)


def slow(command: JointCommand, seconds: float = 0.15) -> JointCommand:
    time.sleep(seconds)
    return command


def stand_still(time_s: float) -> np.ndarray:
    return np.zeros(3)


def short_episode(**changes: object) -> Episode:
    """One second of standing still between a quick rise and a short damping."""
    config = DeployConfig(stand_s=0.4, safety=SafetyConfig(damping_s=0.1))
    return Episode(**{"command_source": stand_still, "duration_s": 1.0, "config": config, **changes})
