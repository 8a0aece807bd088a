"""Runs policies for a while before a run, so that the first steps of a policy used later are not slow."""

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.policy import Policy, PolicyInput, Sensed
from footfall.robots.description import Robot

WARM_UP_S = 1.5  # of the policy's time: enough for the robot to settle and for every foot to take a step
COMMAND = np.array([0.1, 0.0, 0.0])


def warm_up(policy: Policy, robot: Robot) -> None:
    """Run a policy for a robot that stands in its default pose. The policy's next reset discards the
    effects."""
    pose, still = robot.default_pose, np.zeros(len(robot.joint_names))
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    sensed = Sensed(np.zeros(3), np.array([0.0, 0.0, GRAVITY_M_S2]), upright, pose, still, still)
    height = robot.description.standing_height_m
    for step in range(round(WARM_UP_S * policy.rate_hz)):
        inputs = PolicyInput(step / policy.rate_hz, sensed, COMMAND, np.zeros(3), height)
        if step == 0:
            policy.reset(inputs)
        policy.act(inputs)
