"""Loss of the base's clearance above the ground, from legs and IMU."""

from collections.abc import Sequence

import numpy as np

from footfall.common.errors import UserError
from footfall.common.rotations import projected_gravity
from footfall.robots.description import Robot
from footfall.robots.kinematics import Legs


def legs_of(robot: Robot) -> Legs | None:
    """Legs of the robot; None for a robot without legs."""
    try:
        return robot.legs if robot.description.feet else None
    except UserError:
        return None


class Clearance:
    """Clearance between the base's lowest corner and the lowest foot."""

    def __init__(self, robot: Robot) -> None:
        self._legs, self._standing_m = legs_of(robot), robot.description.standing_height_m

    def sunk_share(self, position: np.ndarray, quaternion: Sequence[float] | np.ndarray) -> float:
        """Lost share of the clearance.

        Args:
            position: joint positions, rad, (n,).
            quaternion: orientation of the base, w x y z.

        Returns:
            0 for a standing robot, 1 with a corner of the base as low as the feet; 0 for a robot without
            legs.
        """
        if self._legs is None:
            return 0.0
        up = -projected_gravity(np.array(quaternion))
        foot_height = self._legs.pose(position).foot @ up
        height = float(np.maximum.reduce(self._legs.foot_radius - foot_height))
        base_below = -float(np.minimum.reduce(self._legs.base_corners @ up))
        return 1.0 - (height - base_below) / (self._standing_m - self._legs.base_below)
