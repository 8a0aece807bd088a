"""Feedback used by all controllers based on whole-body control."""

import math
from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_not_negative
from footfall.common.constants import GRAVITY_M_S2
from footfall.common.rotations import rotation_matrix
from footfall.policies.controllers.whole_body.dynamics import FREE_FALL, Dynamics, Motion, WholeBody
from footfall.policies.policy import PolicyInput
from footfall.robots.description import Robot


@dataclass(frozen=True)
class Feedback:
    """Spring and damper: acceleration per deviation, and per rate."""

    stiffness: float  # 1/s^2
    damping: float  # 1/s

    def __post_init__(self) -> None:
        require_not_negative(self, "stiffness", "damping")

    def __call__(self, deviation: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Acceleration that reduces a deviation and its rate to zero."""
        return -self.stiffness * deviation - self.damping * rate


def estimated_dynamics(body: WholeBody, inputs: PolicyInput, gravity: np.ndarray = FREE_FALL) -> Dynamics:
    """Dynamics of a robot with the given inputs; gravity (3,) m/s^2, axes of the inputs' attitude."""
    sensed = inputs.sensed
    velocity = rotation_matrix(sensed.quaternion).dot(inputs.base_velocity)
    return body.update(
        Motion(sensed.quaternion, velocity, sensed.gyro, sensed.joint_position, sensed.joint_velocity),
        gravity,
    )


def rest_dynamics(body: WholeBody, robot: Robot) -> Dynamics:
    """Dynamics of a robot at rest, level, in its default pose."""
    level, still = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
    return body.update(Motion(level, still, still, robot.default_pose, np.zeros_like(robot.default_pose)))


def pendulum_rate(height_m: float) -> float:
    """Growth rate of an inverted pendulum's fall, w = sqrt(g / height), 1/s."""
    return math.sqrt(GRAVITY_M_S2 / height_m)


def base_tilt(quaternion: np.ndarray, dynamics: Dynamics) -> np.ndarray:
    """Tilt of the base, and its yaw relative to the feet: a rotation vector (3,), body frame.
    For small angles; the yaw is relative to the mean heading of the feet.
    """
    rotation = rotation_matrix(quaternion)
    up = rotation[2]
    forward = dynamics.foot_rotation[:, :, 0].sum(axis=0).dot(rotation)  # of the feet, body frame
    return np.array([up[1], -up[0], -math.atan2(forward[1], forward[0])])
