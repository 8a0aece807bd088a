"""Planned motion of a jump: that of the base until take-off, that of the feet afterwards."""

import math
from typing import NamedTuple

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.gait import swing_curve
from footfall.policies.controllers.jump.config import JumpConfig


class Aim(NamedTuple):
    """Target of the base: each (2,), forward from its position in stance and above the ground."""

    position: np.ndarray  # m
    velocity: np.ndarray  # m/s
    acceleration: np.ndarray  # m/s^2


class LeapPlan:
    """Times and speeds of a jump. Times count from the start of the crouch.

    The push is a constant acceleration from rest: it needs the smallest peak force for its length.

    Attributes:
        take_off_s: time of take-off.
        flight_s: duration of the flight.
    """

    def __init__(self, config: JumpConfig) -> None:
        leap, landing, stance_m = config.leap, config.landing, config.plan.stance.height_m
        self._crouch_s = leap.crouch_s
        self._crouch = np.array([-leap.back_m, leap.crouch_m])
        self._stance_m, self._tuck_m = stance_m, config.tuck_m
        upward_m_s = math.sqrt(2.0 * GRAVITY_M_S2 * (stance_m + leap.rise_m - leap.take_off_m))
        push_s = 2.0 * (leap.take_off_m - leap.crouch_m) / upward_m_s
        fall_m = stance_m + leap.rise_m - landing.height_m
        self.flight_s = upward_m_s / GRAVITY_M_S2 + math.sqrt(2.0 * fall_m / GRAVITY_M_S2)
        self.take_off_s = leap.crouch_s + push_s
        displacement = leap.ahead_m + leap.back_m - landing.feet_ahead_m
        velocity = np.array([displacement / (0.5 * push_s + self.flight_s), upward_m_s])  # at take-off
        self._acceleration = velocity / push_s
        take_off = self._crouch + 0.5 * push_s * velocity  # position of the base
        self._lift_off = np.array([-take_off[0], 0.0, -take_off[1]])
        self._touch_down = np.array([landing.feet_ahead_m, 0.0, -landing.height_m])

    def base(self, time_s: float, start_m: float) -> Aim:
        """Motion of the base until take-off, from an initial height `start_m` above its feet."""
        if time_s < self._crouch_s:
            share = time_s / self._crouch_s
            along, start = swing_curve(share).along, np.array([0.0, start_m])
            displacement = self._crouch - start
            return Aim(
                start + along.value * displacement,
                along.slope / self._crouch_s * displacement,
                along.bend / self._crouch_s**2 * displacement,
            )
        push_s = min(time_s, self.take_off_s) - self._crouch_s
        velocity = self._acceleration * push_s
        return Aim(self._crouch + 0.5 * push_s * velocity, velocity, self._acceleration)

    def feet(self, flown_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) m and velocity (3,) m/s of all feet relative to the base, x forward, z up."""
        share = min(max(flown_s / self.flight_s, 0.0), 1.0)
        curve, displacement = swing_curve(share), self._touch_down - self._lift_off
        up = np.array([0.0, 0.0, self._tuck_m])
        position = self._lift_off + curve.along.value * displacement + curve.height.value * up
        velocity = (curve.along.slope * displacement + curve.height.slope * up) / self.flight_s
        return position, velocity
