"""Upward force of the ground on each foot, and the torques that carry the weight."""

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.walk.config import TouchDownConfig
from footfall.policies.controllers.walk.feet import FootCycle
from footfall.robots.actuator import friction_torque
from footfall.robots.description import Robot
from footfall.robots.kinematics import Legs
from footfall.robots.momentum import MomentumObserver, external_torque, upward_force
from footfall.robots.readings import Sensed
from footfall.robots.rigid_body import RigidBody

_UP = np.array([0.0, 0.0, 1.0])  # base frame, which is nearly level


class TouchDown:
    """Ends a swing at an early contact, and lowers stance feet without contact."""

    def __init__(self, robot: Robot, body: RigidBody, config: TouchDownConfig) -> None:
        self._config = config
        self._force = GroundForce(robot, body, config.filter_s, config.inertia_uncertainty)

    def reset(self, sensed: Sensed) -> None:
        """Start with joints without acceleration."""
        self._force.reset(sensed)

    def sense(self, sensed: Sensed, jacobian: np.ndarray, dt_s: float) -> np.ndarray:
        """Update with one set of readings (see `GroundForce.update`); returns the force share of each
        foot, (feet,)."""
        return self._force.update(sensed, jacobian, dt_s)

    def apply(
        self, cycle: FootCycle, force_shares: np.ndarray, tips: np.ndarray, up: tuple[float, ...], dt_s: float
    ) -> None:
        """End swings or lower stance feet, according to the forces.

        Args:
            cycle: feet of the gait.
            force_shares: (feet,) upward force on each foot, as a share of the weight per leg.
            tips: (feet, 3) m, base frame.
            up: (3,) the ground's normal, base frame.
            dt_s: time step of the lowering.
        """
        config = self._config
        low, high = config.force_share
        shares = force_shares.tolist()
        touching = [
            share > high and foot.progress > config.from_progress
            for share, foot in zip(shares, cycle.each_foot, strict=True)
        ]
        if any(touching):
            cycle.touch_down(np.array(touching), tips.dot(up))
        cycle.lower([share < low for share in shares], config.probe_m_s * dt_s, -config.probe_m)


class GroundForce:
    """Upward force of the ground on each foot, as a share of the weight per leg.

    Estimated by a momentum observer, minus the gearboxes' friction. With geared motors, the inertial force of
    a swing exceeds the contact force: 30 N at a foot of the hexapod, whose weight per leg is 5 N. So the
    estimate uses only readings of the same time: the commanded acceleration, which legs follow some 10 ms
    later, is wrong by more than the weight per leg. The inertia matrix M is not known within a percent, so a
    part of the inertial force is left out: the part that accelerates a foot downward.

    Args:
        robot: robot with these legs and gearboxes.
        body: mass and inertia of the legs.
        filter_s: time constant of both filter stages. The first differentiates the momentum. The second
            smooths the noise of the joint velocities in the derivative.
        inertia_uncertainty: share by which M may be too small.
    """

    def __init__(self, robot: Robot, body: RigidBody, filter_s: float, inertia_uncertainty: float) -> None:
        self._legs, self._motor = robot.legs, robot.motor
        self._observer = MomentumObserver(body.leg_inertia, filter_s)
        self._filter_s, self._uncertainty = filter_s, inertia_uncertainty
        self._weight_per_leg = GRAVITY_M_S2 * body.mass / robot.legs.count

    def reset(self, sensed: Sensed) -> None:
        """Start with joints without acceleration."""
        external = self._external(sensed)
        self._observer.reset(external, self._legs.gather(sensed.joint_velocity))
        self._smooth = np.stack([external, np.zeros_like(external)], axis=-1)

    def update(self, sensed: Sensed, jacobian: np.ndarray, dt_s: float) -> np.ndarray:
        """Update with one set of readings; returns the force share of each foot, (feet,).

        A share is negative if the foot is pulled down.

        Args:
            sensed: readings of this tick.
            jacobian: (feet, 3, m) of the tips, base frame.
            dt_s: time since the previous readings.
        """
        rates = self._legs.gather(sensed.joint_velocity)
        share = dt_s / (self._filter_s + dt_s)
        self._smooth += share * (self._observer.update(self._external(sensed), rates, dt_s) - self._smooth)
        static, inertial = upward_force(jacobian, self._smooth, _UP).T
        force: np.ndarray = static + inertial + self._uncertainty * np.minimum(inertial, 0.0)
        return force / self._weight_per_leg

    def _external(self, sensed: Sensed) -> np.ndarray:
        """Torque on each joint that comes neither from its motor nor its gearbox, N m, (legs, m)."""
        friction = friction_torque(sensed.joint_velocity, self._motor, sensed.joint_torque)
        return external_torque(self._legs, sensed, sensed.joint_torque + friction)


def weight_torque(legs: Legs, jacobian: np.ndarray, stands: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Joint torques (legs, m), N m, of stance feet that share a force equally.

    Args:
        legs: kinematics of the legs.
        jacobian: (feet, 3, m) of the tips, base frame.
        stands: (feet,) boolean, feet in stance.
        weight: (3,) N, upward, base frame.
    """
    share = stands / max(1, int(np.count_nonzero(stands)))
    return legs.torque(jacobian, share[:, None] * weight)
