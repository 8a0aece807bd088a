"""Policies of the steps: small joint trajectories, and a fade from standing to another policy."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from footfall.policies.contract import Contract
from footfall.policies.controllers.stance import level_feet
from footfall.policies.policy import Policy, PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

Trajectory = Callable[[float], np.ndarray]  # function of time, s: offsets from the initial pose, rad, (n,)
RATE_HZ = 100.0


def there_and_back(share: float) -> float:
    """Rises from 0 to 1 and falls back to 0 while `share` goes from 0 to 1, at rest at both ends."""
    return 0.5 - 0.5 * math.cos(2.0 * math.pi * share)


class TrajectoryPolicy:
    """Follows a joint trajectory relative to the pose at reset."""

    name = "trajectory"
    rate_hz = RATE_HZ
    needs_estimate = False
    contract: Contract | None = None
    notes: Sequence[str] = ()

    def __init__(self, trajectory: Trajectory, kp: np.ndarray, kd: np.ndarray) -> None:
        """Gains (n,), N m/rad and N m s/rad."""
        self._trajectory, self._kp, self._kd = trajectory, kp, kd
        self._start = np.zeros_like(kp)

    def reset(self, inputs: PolicyInput) -> None:
        self._start = inputs.sensed.joint_position.copy()

    def act(self, inputs: PolicyInput) -> JointCommand:
        zero = np.zeros_like(self._kp)
        return JointCommand(self._start + self._trajectory(inputs.time_s), zero, self._kp, self._kd, zero)

    def stance(self) -> np.ndarray | None:
        return None


class StandingTrajectoryPolicy(TrajectoryPolicy):
    """Follows a joint trajectory relative to the default pose, from any initial pose."""

    def __init__(self, robot: Robot, trajectory: Trajectory, kp: np.ndarray, kd: np.ndarray) -> None:
        super().__init__(trajectory, kp, kd)
        self._default_pose = robot.default_pose

    def reset(self, inputs: PolicyInput) -> None:
        self._start = self._default_pose


def still(robot: Robot) -> Trajectory:
    """Trajectory without motion."""
    zero = np.zeros(len(robot.joint_names))
    return lambda _: zero


def one_after_the_other(
    robot: Robot, groups: Sequence[np.ndarray], travel_rad: float, duration_s: float
) -> Trajectory:
    """Trajectory in which groups of joints (indices) move in turn, each joint towards the middle of its
    range.

    The joints of a group move by `travel_rad` and back within `duration_s`.
    """
    lower, upper = robot.soft_limits
    direction = np.where(robot.default_pose < (lower + upper) / 2, 1.0, -1.0)
    offsets = np.zeros((len(groups), len(lower)))
    for row, group in enumerate(groups):
        offsets[row, group] = travel_rad * direction[group]

    def trajectory(time_s: float) -> np.ndarray:
        index = min(int(time_s / duration_s), len(groups) - 1)
        return there_and_back(min(time_s / duration_s - index, 1.0)) * offsets[index]

    return trajectory


def swaying(robot: Robot, tilt_rad: float, duration_s: float) -> Trajectory:
    """Trajectory that tilts the base to the right, then forward, above its feet in the default pose.

    Each of the two motions reaches `tilt_rad` and takes `duration_s`, with the return.
    """
    legs, pose = robot.legs, robot.default_pose

    def trajectory(time_s: float) -> np.ndarray:
        axis = min(int(time_s / duration_s), 1)
        tilt = np.zeros(2)
        tilt[axis] = tilt_rad * there_and_back(min(time_s / duration_s - axis, 1.0))
        feet = level_feet(legs.default_foot, -tilt)  # feet on level ground below a base tilted by `tilt`
        return legs.scatter(legs.solve(feet), pose) - pose

    return trajectory


class SlewedIn:
    """Fades from standing to the commands of another policy."""

    def __init__(self, policy: Policy, robot: Robot, slew_s: float, kp: np.ndarray, kd: np.ndarray) -> None:
        """Gains (n,) of standing; the fade takes `slew_s`."""
        self.name, self.rate_hz, self.needs_estimate = policy.name, policy.rate_hz, policy.needs_estimate
        zero = np.zeros_like(kp)
        self._policy, self._slew_s = policy, slew_s
        self._stand = np.array([robot.default_pose, zero, kp, kd, zero])

    @property
    def contract(self) -> Contract | None:
        return self._policy.contract

    @property
    def notes(self) -> Sequence[str]:
        return self._policy.notes

    def reset(self, inputs: PolicyInput) -> None:
        self._policy.reset(inputs)

    def act(self, inputs: PolicyInput) -> JointCommand:
        share = min(inputs.time_s / self._slew_s, 1.0) if self._slew_s else 1.0
        command = self._policy.act(inputs)
        if share == 1.0:
            return command
        return JointCommand.of(self._stand + share * (np.array(command, dtype=float) - self._stand))

    def stance(self) -> np.ndarray | None:
        return self._policy.stance()
