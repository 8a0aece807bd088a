"""How firmly the ground holds the feet: the friction that forces may count on."""

import numpy as np

from footfall.common.rotations import cross
from footfall.policies.controllers.mpc.config import Contact
from footfall.robots.kinematics import LegPose, Legs
from footfall.robots.readings import Sensed

_FILTER_S = 0.03  # time constant of the slip, so that a touch-down is none


class Grip:
    """Counts on less friction while feet slip, and for a time after that.

    Feet that stand move alike as seen from the base. What their velocities differ by is slip, whatever the
    base does: no estimate of its velocity is needed.
    """

    def __init__(self, legs: Legs, config: Contact) -> None:
        self._legs, self._config = legs, config
        self.reset()

    def reset(self) -> None:
        """Begin on ground that holds."""
        self._slip_m_s = self._careful_s = 0.0

    @property
    def friction(self) -> float:
        """Coefficient to count on."""
        return self._config.friction if self._careful_s <= 0.0 else self._config.slipping_friction

    def follow(self, sensed: Sensed, pose: LegPose, up: np.ndarray, stance: np.ndarray, dt_s: float) -> None:
        """Look at the feet's velocities.

        Args:
            sensed: readings.
            pose: kinematics at their joint positions.
            up: (3,) vertical, base frame.
            stance: (legs,) planned contact in [0, 1]; only feet with 1 count.
            dt_s: since the last look.
        """
        self._careful_s -= dt_s
        standing = np.flatnonzero(stance == 1.0)
        if len(standing) < 2:
            return
        legs = self._legs
        jacobian = (pose.jacobian + legs.rolling_offset(pose.axes, up))[standing]
        rates = legs.gather(sensed.joint_velocity)[standing]
        velocity = (jacobian @ rates[:, :, None])[:, :, 0] + cross(sensed.gyro, pose.foot[standing])
        apart = velocity - velocity.mean(axis=0)
        across = float(np.einsum("li,li->", apart, apart) - (apart.dot(up) ** 2).sum())
        slip = (max(across, 0.0) / len(standing)) ** 0.5
        self._slip_m_s += dt_s / (_FILTER_S + dt_s) * (slip - self._slip_m_s)
        if self._slip_m_s > self._config.slip_m_s:
            self._careful_s = self._config.careful_s
