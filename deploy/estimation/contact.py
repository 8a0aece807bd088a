"""Contact of each foot, from the force of the ground and the controller's plan.

The force comes from a sensor, if there is one that agrees with the motors' torques; otherwise from these
torques.
"""

import math

import numpy as np

from footfall.common.constants import GRAVITY_M_S2
from footfall.deploy.estimation.config import ContactConfig
from footfall.policies.policy import Sensed
from footfall.robots.kinematics import Legs
from footfall.robots.momentum import MomentumObserver, external_torque, upward_force
from footfall.robots.rigid_body import RigidBody


class ContactEstimator:
    """Probability that each foot is in stance, from the force on it."""

    def __init__(self, legs: Legs, body: RigidBody, config: ContactConfig) -> None:
        self._legs, self._config = legs, config
        self._observer = MomentumObserver(body.leg_inertia, config.force_filter_s)
        even_force = GRAVITY_M_S2 * body.mass / legs.count
        low, high = config.force_share
        self._min_force, self._force_span = low * even_force, (high - low) * even_force
        self._even_force = even_force
        self._carried_m_s2 = (
            config.carried_share * GRAVITY_M_S2
        )  # reading from which on the feet carry the base
        self.probability = [1.0] * legs.count
        self._error = np.full(legs.count, even_force)  # N, mean error of each sensor; unusable at first

    @property
    def trusted(self) -> np.ndarray:
        """Force sensors in use, (legs,) bool; all False without sensors."""
        return self._error < self._config.sensor_error_share * self._even_force

    def reset(self, sensed: Sensed) -> None:
        """Start with all feet in contact."""
        self.probability = [1.0] * self._legs.count
        self._error[:] = self._even_force
        external = external_torque(self._legs, sensed, sensed.joint_torque)
        self._observer.reset(external, self._legs.gather(sensed.joint_velocity))

    def update(
        self,
        sensed: Sensed,
        rates: np.ndarray,
        jacobian: np.ndarray,
        up: np.ndarray,
        plan: np.ndarray | None,
        dt_s: float,
    ) -> list[float]:
        """Update with one set of readings.

        Args:
            sensed: the readings. If torques are NaN (a recording without them), force sensors are used
                unchecked.
            rates: (legs, m) rad/s, joint velocities.
            jacobian: (legs, 3, m) of the contact points.
            up: (3,) vertical, base frame.
            plan: (legs,) planned contact in [0, 1], or None without a plan. A planned contact counts only as
                far as the force agrees.
            dt_s: time since the previous readings.

        Returns:
            Probability of each foot, in [0, 1].
        """
        config = self._config
        external = external_torque(self._legs, sensed, sensed.joint_torque)
        torque = self._observer.update(external, rates, dt_s)
        force = upward_force(jacobian, np.add.reduce(torque, axis=2, keepdims=True), up)[:, 0]
        if len(sensed.foot_force):
            force = self._by_sensors(sensed.foot_force, force, dt_s)
        low, span = self._min_force, self._force_span
        share = 1.0 - math.exp(-dt_s / config.rise_s)
        planned = [1.0] * len(force) if plan is None else plan.tolist()
        # A foot that lifts off is fast immediately, but its force is filtered: the accelerometer is quicker.
        carried = min(max(float(up.dot(sensed.acceleration)) / self._carried_m_s2, 0.0), 1.0)
        for leg, leg_force in enumerate(force.tolist()):
            load = (leg_force - low) / span
            contact = carried * planned[leg] * (0.0 if load < 0.0 else 1.0 if load > 1.0 else load)
            before = self.probability[leg]
            # Contact is lost immediately and gained slowly: a landing foot bounces and slips first.
            self.probability[leg] = contact if contact < before else before + share * (contact - before)
        return self.probability

    def _by_sensors(self, measured: np.ndarray, expected: np.ndarray, dt_s: float) -> np.ndarray:
        """Forces from sensors in use, and otherwise from torques, N, (legs,)."""
        error = np.abs(measured - expected)
        error[np.isnan(measured)] = 2.0 * self._even_force  # a silent sensor must be verified again
        error[np.isnan(expected)] = 0.0
        share = 1.0 - math.exp(-dt_s / self._config.sensor_filter_s)
        self._error += share * (error.clip(max=2.0 * self._even_force) - self._error)
        use = (self.trusted | np.isnan(expected)) & ~np.isnan(measured)
        return np.nan_to_num(np.where(use, measured, expected))
