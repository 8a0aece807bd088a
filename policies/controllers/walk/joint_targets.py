"""Command of all joints from the positions of the tips."""

import numpy as np

from footfall.common.arrays import clamped
from footfall.policies.controllers.walk.config import WalkConfig
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot


class JointTargets:
    """Inverse kinematics within the robot's rate limit, starting at the pose found at reset."""

    def __init__(self, robot: Robot, config: WalkConfig) -> None:
        self._legs, self._default = robot.legs, robot.default_pose
        self._no_torque = np.zeros(len(robot.joint_names))
        self._kp, self._kd = self._no_torque + config.kp, self._no_torque + config.kd
        self._dt_s = 1.0 / config.rate_hz
        self._max_step_rad = robot.description.target_rate_rad_s / config.rate_hz
        self.begin(robot.default_pose)

    def begin(self, position: np.ndarray) -> None:
        """Start from joint positions (n,), rad."""
        self._start = self._previous = position

    def command(self, tips: np.ndarray, share: float, torque: np.ndarray) -> JointCommand:
        """Command of one tick.

        Args:
            tips: (legs, 3) m, base frame.
            share: share of the way from the first positions to those of the tips, 0 to 1.
            torque: (legs, m) N m, feed-forward.
        """
        goal = self._legs.scatter(self._legs.solve(tips), self._default)
        desired = self._start + share * (goal - self._start)
        # The tempo of a steady walk keeps its targets within this limit; a change of gait may exceed it.
        previous, limit = self._previous, self._max_step_rad
        self._previous = position = clamped(desired, previous - limit, previous + limit)
        velocity = (position - previous) / self._dt_s
        return JointCommand(
            position, velocity, self._kp, self._kd, self._legs.scatter(torque, self._no_torque)
        )
