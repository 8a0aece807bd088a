"""What the legs of a robot that stands say of its attitude, against what the IMU says.

Feet on the ground span a plane. The joints alone tell its normal in the base frame, and the IMU alone the way
up in the same frame. The two are apart by the ground's slope, and that does not change while the same feet
stand, however the base sways and the feet slip in their plane. Of a biped nothing is known: two feet are in a
line, and soles tip over their edges without a joint that moves.
"""

import math

import numpy as np

from footfall.deploy.estimation.contact import GRAVITY_M_S2
from footfall.deploy.sensor_checks.table import SensorLimits
from footfall.robots.description import Robot
from footfall.robots.momentum import upward_force

SPREAD = 0.25  # of the standing height: what stands on a narrower strip says nothing of the tilt across it


class LegAttitude:
    """Compares legs and IMU for as long as joints are nearly still and the same feet carry the robot."""

    def __init__(self, robot: Robot, limits: SensorLimits) -> None:
        """Raises UserError of a robot whose limbs are not legs."""
        self._legs, self._settled_s = robot.legs, limits.resting_s
        even_force = GRAVITY_M_S2 * self._legs.mass / self._legs.count
        self._loaded = limits.loaded_share * even_force
        self._least_spread = (SPREAD * robot.description.standing_height_m) ** 2
        self.reset()

    def reset(self) -> None:
        """Nothing is known to stand."""
        self.slope = 0.0  # rad, between the plane of the feet and the IMU's level
        self.turn = 0.0  # rad, of the base since these feet stand, by the IMU other than by the legs
        self._standing = b""  # which feet carry the robot
        self._first: np.ndarray | None = None  # the way up less the normal when they began to
        self._stood_s = 0.0

    def look(self, position: np.ndarray, torque: np.ndarray, up: np.ndarray, elapsed_s: float) -> None:
        """Take in the readings of a robot whose joints are nearly still.

        Args:
            position: of the joints, rad, (n,).
            torque: that the motors report, N m, (n,).
            up: the IMU's way up in the base frame, (3,).
            elapsed_s: since the last look.
        """
        force = self._force(position, torque, up)
        standing = force >= self._loaded
        normal = self._normal(position, standing, up)
        if normal is None:
            self.reset()
            return
        apart = up - normal
        if self._first is None or standing.tobytes() != self._standing:
            self.reset()
            self._standing, self._first = standing.tobytes(), apart
            return
        self._stood_s += elapsed_s
        self.turn = float(np.linalg.norm(apart - self._first))
        if self._stood_s >= self._settled_s:
            self.slope = 2.0 * math.asin(min(1.0, 0.5 * float(np.linalg.norm(apart))))

    def _force(self, position: np.ndarray, torque: np.ndarray, up: np.ndarray) -> np.ndarray:
        """Upward force of the ground on each foot of a robot at rest, N, (legs,)."""
        legs = self._legs
        outside = legs.holding_torque(position, GRAVITY_M_S2 * up) - legs.gather(torque)
        return upward_force(legs.pose(position).jacobian, outside[:, :, None], up)[:, 0]

    def _normal(self, position: np.ndarray, standing: np.ndarray, up: np.ndarray) -> np.ndarray | None:
        """Normal of the plane through what stands, base frame, (3,); None if it spans none."""
        if not standing.any():
            return None
        legs = self._legs
        points = (legs.pose(position).foot - legs.foot_radius[:, None] * up)[standing]
        about = points - points.mean(axis=0)
        spreads, axes = np.linalg.eigh(about.T @ about / len(about))
        if spreads[1] < self._least_spread:
            return None
        normal: np.ndarray = axes[:, 0]
        return normal if normal[2] >= 0.0 else -normal
