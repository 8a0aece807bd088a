"""Which feet stand: from the forces that the ground must exert on them, and from the controller's plan."""

import math

import numpy as np

from footfall.common.linear import solve
from footfall.deploy.estimation.config import ContactConfig
from footfall.policies.policy import Sensed
from footfall.robots.kinematics import Legs
from footfall.robots.rigid_body import RigidBody

GRAVITY_M_S2 = 9.81
_REGULAR = 1e-5 * np.eye(3)  # m^2/rad^2


def ground_force(jacobian: np.ndarray, outside: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Upward force of the ground on each foot, N, (legs,).

    Least squares, regularised: near a singular pose a force is unknown along one direction only.

    Args:
        jacobian: (legs, 3, m) of the points of contact, base frame.
        outside: (legs, m) torque that holds each joint and does not come from its motor, N m.
        up: (3,) vertical, base frame.
    """
    regular = jacobian @ jacobian.transpose(0, 2, 1) + _REGULAR
    force: np.ndarray = solve(regular, jacobian @ outside[:, :, None])[:, :, 0].dot(up)
    return force


class ContactEstimator:
    """Probability that each foot stands still on the ground.

    The force comes from a momentum observer of each limb (De Luca et al. 2006, "Collision detection and safe
    reaction with the DLR-III lightweight manipulator arm"): what changes a limb's momentum beyond its motors'
    torques, less what holds its weight against the base's proper acceleration, comes from the foot,

        J' f = d(M q')/dt + weight - torque.

    Without the first term a leg thrown forward in its swing would look like one that stands; without the
    second a heavy leg that stands would look like one in the air, and one that falls the other way round.
    """

    def __init__(self, legs: Legs, body: RigidBody, config: ContactConfig) -> None:
        self._legs, self._config = legs, config
        self._momentum_rate = body.leg_inertia / config.force_filter_s
        even_force = GRAVITY_M_S2 * body.mass / legs.count
        low, high = config.force_share
        self._least_force, self._force_span = low * even_force, (high - low) * even_force
        self.probability = [1.0] * legs.count

    def reset(self, sensed: Sensed) -> None:
        """Begin with all feet down."""
        self.probability = [1.0] * self._legs.count
        self._filtered = self._outside(sensed) - self._momentum(self._legs.gather(sensed.joint_velocity))

    def update(
        self,
        sensed: Sensed,
        rates: np.ndarray,
        jacobian: np.ndarray,
        up: np.ndarray,
        plan: np.ndarray | None,
        dt_s: float,
    ) -> list[float]:
        """Take in one set of readings.

        Args:
            sensed: the readings.
            rates: (legs, m) rad/s, of the joints.
            jacobian: (legs, 3, m) of the points of contact.
            up: (3,) vertical, base frame.
            plan: (legs,) planned contact in [0, 1], or None where nothing is planned. A planned contact is
                believed as far as the forces at the foot agree.
            dt_s: time since the readings before.

        Returns:
            The probability of each foot, in [0, 1].
        """
        config = self._config
        momentum = self._momentum(rates)
        # Filter and derivative of the momentum in one: what a first-order filter lags behind is its time
        # constant times the rate of change. Exact in steps, too, where the filter is Euler's backward one.
        share = dt_s / (config.force_filter_s + dt_s)
        self._filtered += share * (self._outside(sensed) - momentum - self._filtered)
        force = ground_force(jacobian, self._filtered + momentum, up)
        low, span = self._least_force, self._force_span
        share = 1.0 - math.exp(-dt_s / config.rise_s)
        planned = [1.0] * len(force) if plan is None else plan.tolist()
        for leg, pressed in enumerate(force.tolist()):
            load = (pressed - low) / span
            present = planned[leg] * (0.0 if load < 0.0 else 1.0 if load > 1.0 else load)
            before = self.probability[leg]
            # Lost at once, won slowly.
            self.probability[leg] = present if present < before else before + share * (present - before)
        return self.probability

    def _momentum(self, rates: np.ndarray) -> np.ndarray:
        """Each limb's momentum over the filter's time constant, N m, (legs, m)."""
        return (self._momentum_rate @ rates[:, :, None])[:, :, 0]

    def _outside(self, sensed: Sensed) -> np.ndarray:
        """Torque that holds each joint and does not come from its motor, N m, (legs, m)."""
        holding = self._legs.holding_torque(sensed.joint_position, sensed.acceleration)
        return holding - self._legs.gather(sensed.joint_torque)
