"""The friction coefficient that planned forces may use: less while feet slip."""

import math

import numpy as np

from footfall.common.rotations import cross
from footfall.policies.controllers.mpc.config import Contact
from footfall.robots.kinematics import LegPose, Legs
from footfall.robots.readings import Sensed

_FRICTION_STEP = 0.05  # few values on slopes, since each has programmes of its own
_FILTER_S = 0.03  # time constant of the slip, so that a touch-down does not count


class Grip:
    """Counts on less friction while feet slip, and for a time after that.

    Seen from the base, all stance feet move with the same velocity. Differences between their velocities are
    slip, whatever the base does: no estimate of its velocity is needed.
    """

    def __init__(self, legs: Legs, config: Contact) -> None:
        self._legs, self._config = legs, config
        self.reset()

    def reset(self) -> None:
        """Begin on ground that holds."""
        self._slip_m_s = self._careful_s = 0.0

    def friction(self, gradient: float) -> float:
        """Friction coefficient for planned forces on ground of a gradient (rise over run, not negative).

        A slope holds no robot that counts on less friction than its gradient: slipping or not, what planned
        forces may use beyond that is at least the coefficient of slipping feet.
        """
        config = self._config
        friction = config.friction if self._careful_s <= 0.0 else config.slipping_friction
        if gradient <= 0.0:
            return friction
        least = math.ceil((gradient + config.slipping_friction) / _FRICTION_STEP) * _FRICTION_STEP
        return max(friction, least)

    def follow(self, sensed: Sensed, pose: LegPose, up: np.ndarray, stance: np.ndarray, dt_s: float) -> None:
        """Update the slip from the feet's velocities.

        Args:
            sensed: readings.
            pose: kinematics at their joint positions.
            up: (3,) vertical, base frame.
            stance: (legs,) planned contact in [0, 1]; only feet with 1 count.
            dt_s: time since the last call.
        """
        self._careful_s -= dt_s
        standing = np.flatnonzero(stance == 1.0)
        if len(standing) < 2:
            return
        legs = self._legs
        jacobian = (pose.jacobian + legs.rolling_offset(pose.axes, up))[standing]
        rates = legs.gather(sensed.joint_velocity)[standing]
        velocity = (jacobian @ rates[:, :, None])[:, :, 0] + cross(sensed.gyro, pose.foot[standing])
        difference = velocity - velocity.mean(axis=0)
        horizontal_sq = float(np.einsum("li,li->", difference, difference) - (difference.dot(up) ** 2).sum())
        slip = (max(horizontal_sq, 0.0) / len(standing)) ** 0.5
        self._slip_m_s += dt_s / (_FILTER_S + dt_s) * (slip - self._slip_m_s)
        if self._slip_m_s > self._config.slip_m_s:
            self._careful_s = self._config.careful_s
