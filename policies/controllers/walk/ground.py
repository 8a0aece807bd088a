"""How hard the ground pushes each foot up, and the torques that push back."""

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.policies.controllers.walk.config import TouchDownConfig
from footfall.policies.controllers.walk.feet import FootCycle
from footfall.robots.actuator import friction_torque
from footfall.robots.description import Robot
from footfall.robots.kinematics import Legs
from footfall.robots.momentum import MomentumObserver, outside_torque, upward_force
from footfall.robots.readings import Sensed
from footfall.robots.rigid_body import RigidBody

_UP = np.array([0.0, 0.0, 1.0])  # of the base, which is nearly level


class TouchDown:
    """Feet that meet the ground early stand; feet that should stand and do not are lowered a little."""

    def __init__(self, robot: Robot, body: RigidBody, config: TouchDownConfig) -> None:
        self._config = config
        self._force = GroundForce(robot, body, config.filter_s, config.inertia_doubt)

    def reset(self, sensed: Sensed) -> None:
        """Begin with joints that nothing accelerates."""
        self._force.reset(sensed)

    def sense(self, sensed: Sensed, jacobian: np.ndarray, dt_s: float) -> np.ndarray:
        """Take in one set of readings (see `GroundForce.update`); returns the share of each foot, (feet,)."""
        return self._force.update(sensed, jacobian, dt_s)

    def apply(
        self, cycle: FootCycle, pushed: np.ndarray, tips: np.ndarray, up: tuple[float, ...], dt_s: float
    ) -> None:
        """Let feet of a gait stand, or lower them.

        Args:
            cycle: the feet.
            pushed: (feet,) share of an even part of the weight with which the ground pushes each up.
            tips: (feet, 3) m, base frame.
            up: (3,) the ground's normal, base frame.
            dt_s: how long feet that find no ground are lowered.
        """
        config = self._config
        least, enough = config.force_share
        shares = pushed.tolist()
        met = [
            share > enough and foot.progress > config.from_progress
            for share, foot in zip(shares, cycle.each_foot, strict=True)
        ]
        if any(met):
            cycle.touch_down(np.array(met), tips.dot(up))
        cycle.lower([share < least for share in shares], config.probe_m_s * dt_s, -config.probe_m)


class GroundForce:
    """Upward force of the ground on each foot, as a share of an even part of the robot's weight.

    By the momentum observer, less the gearboxes' friction. Geared motors weigh more in a swing than the
    ground pushes: the hexapod's take 30 N at the foot, an even part of its weight is 5 N. So all of it is of
    readings that were taken together: the commanded acceleration, which legs follow some 10 ms later, is off
    by more than a share. And as nobody knows M to the percent, a part of the force that makes a foot fall
    faster than it would by itself is left out.

    Args:
        robot: whose legs and gearboxes.
        body: mass and legs' inertia.
        filter_s: time constant of both stages of the filter: the first one differentiates the momentum, the
            second one takes out what that makes of the joint velocities' noise.
        inertia_doubt: share by which M may be too small.
    """

    def __init__(self, robot: Robot, body: RigidBody, filter_s: float, inertia_doubt: float) -> None:
        self._legs, self._motor = robot.legs, robot.motor
        self._observer = MomentumObserver(body.leg_inertia, filter_s)
        self._filter_s, self._doubt = filter_s, inertia_doubt
        self._even_force = GRAVITY_M_S2 * body.mass / robot.legs.count

    def reset(self, sensed: Sensed) -> None:
        """Begin with joints that nothing accelerates."""
        outside = self._outside(sensed)
        self._observer.reset(outside, self._legs.gather(sensed.joint_velocity))
        self._smooth = np.stack([outside, np.zeros_like(outside)], axis=-1)

    def update(self, sensed: Sensed, jacobian: np.ndarray, dt_s: float) -> np.ndarray:
        """Take in one set of readings; returns the share of each foot, (feet,), negative where it is pulled.

        Args:
            sensed: the readings.
            jacobian: (feet, 3, m) of the tips, base frame.
            dt_s: time since the readings before.
        """
        rates = self._legs.gather(sensed.joint_velocity)
        share = dt_s / (self._filter_s + dt_s)
        self._smooth += share * (self._observer.update(self._outside(sensed), rates, dt_s) - self._smooth)
        held, inertial = upward_force(jacobian, self._smooth, _UP).T
        force: np.ndarray = held + inertial + self._doubt * np.minimum(inertial, 0.0)
        return force / self._even_force

    def _outside(self, sensed: Sensed) -> np.ndarray:
        """Torque that holds each joint and comes neither from its motor nor its gearbox, N m, (legs, m)."""
        own = sensed.joint_torque + friction_torque(sensed.joint_velocity, self._motor, sensed.joint_torque)
        return outside_torque(self._legs, sensed, own)


def weight_torque(legs: Legs, jacobian: np.ndarray, stands: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Joint torques (legs, m), N m, of feet that share a force evenly.

    Args:
        legs: whose.
        jacobian: (feet, 3, m) of the tips, base frame.
        stands: (feet,) boolean, those that do.
        weight: (3,) N, upward, base frame.
    """
    share = stands / max(1, int(np.count_nonzero(stands)))
    return legs.torque(jacobian, share[:, None] * weight)
