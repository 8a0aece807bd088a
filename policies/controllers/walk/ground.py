"""How hard the ground pushes each foot up."""

import numpy as np

from footfall.common.linear import solve
from footfall.robots.actuator import friction_torque
from footfall.robots.description import Robot
from footfall.robots.readings import Sensed
from footfall.robots.rigid_body import RigidBody

_REGULAR = 1e-5 * np.eye(3)  # m^2/rad^2
_GRAVITY = 9.81


class GroundForce:
    """Upward force of the ground on each foot, as a share of an even part of the robot's weight.

    From a momentum observer of each limb (De Luca et al. 2006, "Collision detection and safe reaction with
    the DLR-III lightweight manipulator arm"),

        J' f = d(M q')/dt + weight - motors' torque + friction.

    Geared motors weigh more in a swing than the ground pushes: the hexapod's take 30 N at the foot, an even
    part of its weight is 5 N. So all of it is of readings that were taken together: the commanded
    acceleration, which legs follow some 10 ms later, is off by more than a share. And as nobody knows M to
    the percent, a part of the force that makes a foot fall faster than it would by itself is left out.

    Args:
        robot: whose legs and gearboxes.
        body: mass and legs' inertia.
        filter_s: time constant of both stages of the filter: the first one differentiates the momentum, the
            second one takes out what that makes of the joint velocities' noise.
        inertia_doubt: share by which M may be too small.
    """

    def __init__(self, robot: Robot, body: RigidBody, filter_s: float, inertia_doubt: float) -> None:
        self._legs, self._motor, self._inertia = robot.legs, robot.motor, body.leg_inertia
        self._filter_s, self._doubt = filter_s, inertia_doubt
        self._even_force = _GRAVITY * body.mass / robot.legs.count

    def reset(self, sensed: Sensed) -> None:
        """Begin with joints that nothing accelerates."""
        outside, momentum = self._outside(sensed), self._momentum(sensed)
        self._slow = np.stack([outside, momentum], axis=-1)
        self._smooth = np.stack([outside, np.zeros_like(momentum)], axis=-1)

    def update(self, sensed: Sensed, jacobian: np.ndarray, dt_s: float) -> np.ndarray:
        """Take in one set of readings; returns the share of each foot, (feet,), negative where it is pulled.

        Args:
            sensed: the readings.
            jacobian: (feet, 3, m) of the tips, base frame.
            dt_s: time since the readings before.
        """
        outside, momentum = self._outside(sensed), self._momentum(sensed)
        share = dt_s / (self._filter_s + dt_s)
        self._slow += share * (np.stack([outside, momentum], axis=-1) - self._slow)
        rate = (momentum - self._slow[:, :, 1]) / self._filter_s
        self._smooth += share * (np.stack([self._slow[:, :, 0], rate], axis=-1) - self._smooth)
        regular = jacobian @ jacobian.transpose(0, 2, 1) + _REGULAR
        held, inertial = solve(regular, jacobian @ self._smooth)[:, 2].T
        force: np.ndarray = held + inertial + self._doubt * np.minimum(inertial, 0.0)
        return force / self._even_force

    def _momentum(self, sensed: Sensed) -> np.ndarray:
        """Of each limb's joints, N m s, (legs, m)."""
        return (self._inertia @ self._legs.gather(sensed.joint_velocity)[:, :, None])[:, :, 0]

    def _outside(self, sensed: Sensed) -> np.ndarray:
        """Torque that holds each joint and comes neither from its motor nor its gearbox, N m, (legs, m)."""
        legs, own = self._legs, sensed.joint_torque + friction_torque(sensed.joint_velocity, self._motor)
        return legs.holding_torque(sensed.joint_position, sensed.acceleration) - legs.gather(own)
