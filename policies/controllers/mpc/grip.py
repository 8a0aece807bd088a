"""Friction coefficient that planned forces may use: smaller while feet slip."""

import math

import numpy as np

from footfall.common.rotations import cross
from footfall.policies.controllers.mpc.config import Contact
from footfall.robots.kinematics import LegPose, Legs
from footfall.robots.readings import Sensed

_FRICTION_STEP = 0.05  # on slopes, friction is a multiple of it: the solver caches a program for each value
_FILTER_S = 0.03  # time constant of the slip velocity, so that a touch-down does not count as slip


class Grip:
    """Reduces the friction coefficient while feet slip, and for some time afterwards.

    Relative to the base, all stance feet have the same velocity. Differences between their velocities are
    slip, whatever the base does: no estimate of the base's velocity is needed.
    """

    def __init__(self, legs: Legs, config: Contact) -> None:
        self._legs, self._config = legs, config
        self.reset()

    def reset(self) -> None:
        """Start without slip."""
        self._slip_m_s = self._careful_s = 0.0

    def friction(self, gradient: float) -> float:
        """Friction coefficient for planned forces on ground of a given gradient (rise over run, not
        negative).

        On a slope, a robot slides if the coefficient is below the gradient. So the coefficient is at least
        the gradient plus the coefficient of slipping feet.
        """
        config = self._config
        friction = config.friction if self._careful_s <= 0.0 else config.slipping_friction
        if gradient <= 0.0:
            return friction
        needed = math.ceil((gradient + config.slipping_friction) / _FRICTION_STEP) * _FRICTION_STEP
        return max(friction, needed)

    def follow(self, sensed: Sensed, pose: LegPose, up: np.ndarray, stance: np.ndarray, dt_s: float) -> None:
        """Update the slip from the feet's velocities.

        Args:
            sensed: readings of this tick.
            pose: kinematics at these joint positions.
            up: (3,) vertical direction, base frame.
            stance: (legs,) planned contact in [0, 1]; only feet with 1 are used.
            dt_s: time since the last call.
        """
        self._careful_s -= dt_s
        standing = (stance == 1.0).nonzero()[0]
        if len(standing) < 2:
            return
        legs = self._legs
        jacobian = (pose.jacobian + legs.rolling_offset(pose.axes, up)).take(standing, axis=0)
        rates = legs.gather(sensed.joint_velocity).take(standing, axis=0)
        velocity = (jacobian @ rates[:, :, None])[:, :, 0] + cross(sensed.gyro, pose.foot[standing])
        difference = velocity - np.add.reduce(velocity) / len(standing)
        vertical = difference.dot(up)
        horizontal_sq = float(
            np.einsum("li,li->", difference, difference) - np.add.reduce(vertical * vertical)
        )
        slip = (max(horizontal_sq, 0.0) / len(standing)) ** 0.5
        self._slip_m_s += dt_s / (_FILTER_S + dt_s) * (slip - self._slip_m_s)
        if self._slip_m_s > self._config.slip_m_s:
            self._careful_s = self._config.careful_s
