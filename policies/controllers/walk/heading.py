"""The heading that a walk keeps to."""

from footfall.common.rotations import wrap_angle
from footfall.policies.controllers.walk.config import HeadingConfig


class Heading:
    """Turns the robot back to the heading that the commanded yaw rate leads to."""

    def __init__(self, config: HeadingConfig) -> None:
        self._config = config
        self.reset()

    def reset(self) -> None:
        """Keep to whatever heading the next call finds."""
        self._yaw: float | None = None  # rad, after the last call

    def correction(self, yaw: float, turned: float) -> float:
        """Yaw rate, rad/s, towards the heading.

        Args:
            yaw: of the base, rad.
            turned: by how much the command turns the heading until the next call, rad.
        """
        most = self._config.most_rad
        ahead = 0.0 if self._yaw is None else wrap_angle(self._yaw - yaw)
        ahead = min(max(ahead, -most), most)
        self._yaw = yaw + ahead + turned
        return self._config.gain * ahead
