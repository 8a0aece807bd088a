"""Attitude of a standing robot from its legs, compared with that from the IMU.

Standing feet span a plane. The joints give its normal in the base frame, the IMU gives the world's up in the
same frame. The angle between the two is the ground's slope. It is constant while the same feet stand, however
the base sways and the feet slip in their plane. A biped gives no information: two feet are on a line, and
soles tip over their edges without a moving joint.
"""

import math

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.robots.description import Robot
from footfall.robots.momentum import upward_force

MIN_SPREAD = 0.25  # of the standing height: feet in a narrower strip give no tilt across it


class LegAttitude:
    """Compares legs and IMU while joints are nearly at rest and the same feet carry the robot."""

    def __init__(self, robot: Robot, limits: SensorLimits) -> None:
        """Raises UserError for a robot whose limbs are not legs."""
        self._legs, self._settle_s = robot.legs, limits.resting_s
        even_force = GRAVITY_M_S2 * self._legs.mass / self._legs.count
        self._loaded = limits.loaded_share * even_force
        self._min_variance = (MIN_SPREAD * robot.description.standing_height_m) ** 2
        self.reset()

    def reset(self) -> None:
        """Start without known stance feet."""
        self.slope = 0.0  # rad, between the plane of the feet and the IMU's level
        self.turn = 0.0  # rad, rotation of the base since these feet stand, by the IMU minus by the legs
        self._standing = b""  # feet that carry the robot
        self._first_difference: np.ndarray | None = None  # up minus normal when these feet started to stand
        self._stood_s = 0.0

    def update(self, position: np.ndarray, torque: np.ndarray, up: np.ndarray, elapsed_s: float) -> None:
        """Update with the readings of a robot whose joints are nearly at rest.

        Args:
            position: joint positions, rad, (n,).
            torque: reported torques, N m, (n,).
            up: world's up by the IMU, base frame, (3,).
            elapsed_s: time since the last call.
        """
        force = self._force(position, torque, up)
        standing = force >= self._loaded
        normal = self._normal(position, standing, up)
        if normal is None:
            self.reset()
            return
        difference = up - normal
        if self._first_difference is None or standing.tobytes() != self._standing:
            self.reset()
            self._standing, self._first_difference = standing.tobytes(), difference
            return
        self._stood_s += elapsed_s
        self.turn = float(np.linalg.norm(difference - self._first_difference))
        if self._stood_s >= self._settle_s:
            self.slope = 2.0 * math.asin(min(1.0, 0.5 * float(np.linalg.norm(difference))))

    def _force(self, position: np.ndarray, torque: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Upward force of the ground on each foot of a robot at rest, N, (legs,)."""
        legs = self._legs
        external = legs.holding_torque(position, GRAVITY_M_S2 * up) - legs.gather(torque)
        return upward_force(legs.pose(position).jacobian, external[:, :, None], up)[:, 0]

    def _normal(self, position: np.ndarray, standing: np.ndarray, up: np.ndarray) -> np.ndarray | None:
        """Normal of the plane through the standing feet, base frame, (3,); None if they span no plane."""
        if not standing.any():
            return None
        legs = self._legs
        points = (legs.pose(position).foot - legs.foot_radius[:, None] * up)[standing]
        centred = points - points.mean(axis=0)
        variances, axes = np.linalg.eigh(centred.T @ centred / len(centred))
        if variances[1] < self._min_variance:
            return None
        normal: np.ndarray = axes[:, 0]
        return normal if normal[2] >= 0.0 else -normal
