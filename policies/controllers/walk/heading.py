"""Heading of a walk."""

from footfall.common.rotations import wrap_angle
from footfall.policies.controllers.walk.config import HeadingConfig


class Heading:
    """Turns the robot back to its heading, the integral of the commanded yaw rate."""

    def __init__(self, config: HeadingConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Start with the heading of the next call."""
        self._yaw: float | None = None  # rad, desired heading after the last call

    def correction(self, yaw: float, turned: float) -> float:
        """Yaw rate, rad/s, towards the heading.

        Args:
            yaw: yaw of the base, rad.
            turned: commanded change of the heading until the next call, rad.
        """
        limit = self._config.max_rad
        error = 0.0 if self._yaw is None else wrap_angle(self._yaw - yaw)
        error = min(max(error, -limit), limit)
        self._yaw = yaw + error + turned
        return self._config.gain * error
