"""Which feet feel the ground."""

import numpy as np

from footfall.robots.kinematics import Legs
from footfall.robots.rigid_body import RigidBody

_REGULAR = 1e-5 * np.eye(3)  # m^2/rad^2
_GRAVITY = 9.81


class GroundSense:
    """Tells by the motors' torques which feet the ground pushes up.

    Torque beyond that of the legs' own inertia comes from the feet. Without taking that off, a leg slowing
    down at the end of its swing would look like one on the ground.

    Args:
        legs: whose feet.
        body: mass and legs' inertia.
        force_share: of an even share of the weight, from which on a foot counts as on the ground.
    """

    def __init__(self, legs: Legs, body: RigidBody, force_share: float) -> None:
        self._legs, self._inertia = legs, body.leg_inertia
        self._least_force = force_share * _GRAVITY * body.mass / legs.count

    def touches(self, jacobian: np.ndarray, torque: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
        """Which feet feel the ground, boolean (feet,).

        Args:
            jacobian: (feet, 3, m) of the tips.
            torque: (n,) N m, of the motors.
            acceleration: (n,) rad/s^2, of the joints.
        """
        gather = self._legs.gather
        inertial = self._inertia @ gather(acceleration)[:, :, None]
        pushed = jacobian @ (gather(torque)[:, :, None] - inertial)
        regular = jacobian @ jacobian.transpose(0, 2, 1) + _REGULAR
        return -np.linalg.solve(regular, pushed)[:, 2, 0] > self._least_force
