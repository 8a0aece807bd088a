"""Trajectory of a swing foot: minimum jerk towards a foothold that may change, and a lift."""

import math

import numpy as np

_XY_YAW = [0, 1, 3]  # columns of x, y and yaw in the result


class Swing:
    """Reference of a swing foot: x, y and yaw with minimum jerk, and a height by progress.

    A minimum-jerk motion that comes to rest at its goal after a time s starts with the jerk
    60 d / s^3 - 36 v / s^2 - 9 a / s, d being the remaining distance (Flash and Hogan 1985). It is evaluated
    again at each tick, so that a change of the goal needs no new plan.

    Args:
        position: (2,) m, position of the foot.
        height: m, height above the stance foot.
        yaw: rad.
        lift_m: largest height above the ground.
        depth_m: depth below the ground at the end of the swing, for a reliable contact.
    """

    def __init__(
        self, position: np.ndarray, height: float, yaw: float, lift_m: float, depth_m: float
    ) -> None:
        self._motion = np.zeros((3, 3))  # value, rate and acceleration of x, y, yaw
        self._motion[0] = *position, yaw
        self._height, self._lift_m, self._depth_m = height, lift_m, depth_m
        self.progress = 0.0

    @property
    def yaw(self) -> float:
        """Yaw of the reference, rad, unwrapped."""
        return float(self._motion[0, 2])

    def advance(self, goal: np.ndarray, remaining_s: float, dt_s: float) -> np.ndarray:
        """Advance by one tick.

        Args:
            goal: (3,) x, y in m and yaw in rad.
            remaining_s: time until touch-down.
            dt_s: duration of the tick.

        Returns:
            (3, 4): position, velocity and acceleration of x, y, height and yaw.
        """
        duration_s = max(remaining_s, 4 * dt_s)
        value, rate, acceleration = self._motion
        jerk = 60 * (goal - value) / duration_s**3 - 36 * rate / duration_s**2 - 9 * acceleration / duration_s
        acceleration = acceleration + jerk * dt_s
        rate = rate + acceleration * dt_s
        self._motion = np.array([value + rate * dt_s, rate, acceleration])
        result = np.empty((3, 4))
        result[:, _XY_YAW] = self._motion
        pace = (1.0 - self.progress) / duration_s
        self.progress = min(1.0, self.progress + pace * dt_s)
        result[:, 2] = self._vertical(self.progress, pace)
        return result

    def _vertical(self, s: float, pace: float) -> tuple[float, float, float]:
        """Height and its first two derivatives: a bump, from the height at lift-off to below the ground."""
        drop = self._height + self._depth_m
        bump = 16.0 * self._lift_m
        height = self._height - drop * s * s * (3 - 2 * s) + bump * s**2 * (1 - s) ** 2
        slope = -drop * 6 * s * (1 - s) + bump * 2 * s * (1 - s) * (1 - 2 * s)
        bend = -drop * (6 - 12 * s) + bump * 2 * (1 - 6 * s + 6 * s * s)
        return height, slope * pace, bend * pace * pace


def matrix_yaw(rotation: np.ndarray) -> float:
    """Heading of a rotation matrix (3, 3), rad."""
    return math.atan2(rotation[1, 0], rotation[0, 0])
