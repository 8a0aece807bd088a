"""Example of a controller: push-ups, with standing feet and legs solved by inverse kinematics.

    footfall deploy push_ups:PushUps --command 0,0,0 --duration 10

A controller is a class that is built from a robot. It can be used wherever a policy is expected, on the
simulated bus and on hardware, and works for every robot with legs.
"""

import numpy as np

from footfall.policies.policy import PolicyInput
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot


class PushUps:
    """Lowers and raises the base by 15 % of its height, with a period of 2 s."""

    name = "push-ups"
    rate_hz = 100.0  # how often the loop calls act
    needs_estimate = False  # it does not use base_velocity and base_height
    contract = None  # only for learned policies
    notes = ()  # lines to print once, such as a clamped setting

    period_s = 2.0
    depth = 0.15

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._kp, self._kd = robot.kp, robot.kd
        self._zero = np.zeros(len(robot.joint_names))

    def reset(self, inputs: PolicyInput) -> None:
        """Start an episode from standing. There is no state to clear: `act` depends only on time."""

    def act(self, inputs: PolicyInput) -> JointCommand:
        """Joint targets until the next call."""
        cycle = inputs.time_s / self.period_s
        share = self.depth * 0.5 * (1.0 - np.cos(2.0 * np.pi * cycle))
        legs = self._robot.legs
        foot = legs.default_foot.copy()  # (feet, 3), m, in the base frame
        foot[:, 2] *= 1.0 - share
        position = legs.scatter(legs.solve(foot), self._robot.default_pose)
        return JointCommand(position, self._zero, self._kp, self._kd, self._zero)

    def stance(self) -> np.ndarray:
        """Planned contact of all feet, used by the base's estimator."""
        return np.ones(self._robot.legs.count)
