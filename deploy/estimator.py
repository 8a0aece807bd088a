"""The base's velocity and height from IMU, joints and contacts: a linear Kalman filter.

The filter is that of Bledt et al. 2018 ("MIT Cheetah 3", section III-C) with three changes:

- Feet are kept relative to the body, so the state holds only what can be observed: no absolute position,
  whose variance would grow for ever. Per world axis it is (v, r_1 .. r_L), and since all noise is isotropic,
  the three axes share one (1 + L, 1 + L) covariance.
- v is the velocity of the IMU, not of the base: its derivative is what the accelerometer measures, with no
  angular acceleration in it. The lever arm enters once, in the result, through the gyro.
- Feet are balls that roll: it is the lowest point of a standing foot that does not move, not its centre.
"""

import math
from dataclasses import dataclass

import numpy as np

from footfall.common.rotations import rotation_matrix, skew
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot
from footfall.robots.model import imu_position
from footfall.robots.rigid_body import nominal_body

GRAVITY = np.array([0.0, 0.0, -9.81])
_REGULAR = 1e-5 * np.eye(3)  # m^2/rad^2


@dataclass(frozen=True)
class EstimatorConfig:
    """Noise figures (standard deviations) and trust in contacts.

    A foot that does not stand is trusted less: its noise grows by up to `swing_noise`. Contact forces are
    shares of the force on each foot of a robot that stands on all of them. The acceleration's noise covers
    touch-down shocks, and pushes too short for the accelerometer to see.
    """

    acceleration_noise: float = 6.0  # m/s^2 in one reading
    foot_drift_noise: float = 0.02  # m/s in each of a standing foot's steps: slip
    foot_place_noise: float = 0.003  # m, of leg kinematics
    foot_velocity_noise: float = 0.1  # m/s, of leg kinematics
    swing_noise: float = 1000.0
    contact_force_low: float = 0.4  # an upward force below it: no contact
    contact_force_high: float = 1.0  # above it: full contact
    force_filter_s: float = 0.006  # time constant of the force estimate


class BaseEstimator:
    """Estimates how the base moves from what the robot senses.

    Args:
        robot: its nominal geometry is used, never a plant's.
        config: noise figures.
    """

    def __init__(self, robot: Robot, config: EstimatorConfig | None = None) -> None:
        self._config = config or EstimatorConfig()
        self._legs = robot.legs
        self._imu = imu_position(robot)
        self._radius = self._legs.foot_radius[:, None]
        self._feet = np.arange(1, 1 + self._legs.count)  # rows of the state
        self._identity = np.eye(1 + self._legs.count)
        self._place_noise = self._config.foot_place_noise**2 * self._identity
        self._place_noise[0, 0] = 0.0  # the velocity's comes with its measurements
        body = nominal_body(robot)
        self._leg_inertia = body.leg_inertia
        self._even_force = -GRAVITY[2] * body.mass / self._legs.count

    def reset(self, sensed: Sensed) -> None:
        """Begin at rest, all feet down."""
        legs = self._legs
        self._momentum = (self._leg_inertia @ legs.gather(sensed.joint_velocity)[:, :, None])[:, :, 0]
        self._outside_torque = -legs.gather(sensed.joint_torque)
        rotation = rotation_matrix(sensed.quaternion)
        feet = (legs.pose(sensed.joint_position).foot - self._imu) @ rotation.T
        self._state = np.vstack([np.zeros(3), feet])  # (1 + legs, 3): v, then r of each foot, world axes
        self._covariance = np.diag([0.01] + [0.01**2] * legs.count)
        self._height = self._height_above(feet, np.ones(legs.count))

    def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple[np.ndarray, float]:
        """Take in one set of readings.

        Args:
            sensed: the readings.
            stance: (legs,) planned contact in [0, 1], or None where nothing is planned. A planned contact is
                believed as far as the forces at the foot agree.
            dt_s: time since the readings before.

        Returns:
            The base origin's velocity in the body frame, (3,) m/s, and its height above the centre of
            the mean standing foot, m.
        """
        legs = self._legs
        rotation = rotation_matrix(sensed.quaternion)
        to_world, up = rotation.T, rotation[2]
        pose = legs.pose(sensed.joint_position)
        rolling = legs.rolling_offset(pose.axes, up)
        contact_jacobian = pose.jacobian + rolling
        rates = legs.gather(sensed.joint_velocity)[:, :, None]

        trust = self._contact(sensed, contact_jacobian, up, dt_s)
        if stance is not None:
            trust = trust * stance
        noise = self._config.swing_noise ** (2.0 - 2.0 * trust)

        place = pose.foot - self._imu
        lowest = self._radius * -up
        turning = skew(sensed.gyro).T
        standing_rate = (contact_jacobian @ rates)[:, :, 0] + (place + lowest) @ turning
        rolling_rate = (rolling @ rates)[:, :, 0] + lowest @ turning
        foot_velocity = rolling_rate @ -to_world  # of a standing foot's centre, in the world

        self._predict(rotation @ sensed.acceleration + GRAVITY, foot_velocity, noise, dt_s)
        self._correct(standing_rate @ -to_world, place @ to_world, noise)

        velocity = self._state[0] @ rotation - self._imu @ turning
        if trust.sum() > 0.5:
            self._height = self._height_above(self._state[1:], trust)
        else:
            self._height += float(self._state[0, 2]) * dt_s
        return velocity, self._height - float(up @ self._imu)

    def _contact(self, sensed: Sensed, jacobian: np.ndarray, up: np.ndarray, dt_s: float) -> np.ndarray:
        """Trust in each foot's contact (legs,) from the force that the ground must exert on it.

        A leg's momentum observer (De Luca et al. 2006): what changes the momentum of a leg beyond its motors'
        torques comes from the foot, J' f = d(M q')/dt - tau. Without the first term, a leg that is thrown
        forwards in its swing would look like one that stands.
        """
        config = self._config
        rates = self._legs.gather(sensed.joint_velocity)
        momentum = (self._leg_inertia @ rates[:, :, None])[:, :, 0]
        outside = (momentum - self._momentum) / dt_s - self._legs.gather(sensed.joint_torque)
        self._momentum = momentum
        self._outside_torque += (1.0 - math.exp(-dt_s / config.force_filter_s)) * (
            outside - self._outside_torque
        )
        # Least squares, regularised: near a singular pose a force is unknown along one direction only.
        pushed = jacobian @ self._outside_torque[:, :, None]
        regular = jacobian @ jacobian.transpose(0, 2, 1) + _REGULAR
        force = np.linalg.solve(regular, pushed)[:, :, 0] @ up / self._even_force
        trust = (force - config.contact_force_low) / (config.contact_force_high - config.contact_force_low)
        return trust.clip(0.0, 1.0)

    def _predict(
        self, acceleration: np.ndarray, foot_velocity: np.ndarray, noise: np.ndarray, dt_s: float
    ) -> None:
        """v' = v + a dt; r' = r + (u - v - a dt / 2) dt, where u is the velocity of a rolling foot's centre.

        Args:
            acceleration: a, (3,) m/s^2.
            foot_velocity: u, (legs, 3) m/s.
            noise: (legs,) factor on the variance of each foot's drift.
            dt_s: time that passes.
        """
        config, feet = self._config, self._feet
        transition = self._identity.copy()
        transition[1:, 0] = -dt_s
        self._state = transition @ self._state
        self._state[0] += acceleration * dt_s
        self._state[1:] += (foot_velocity - acceleration * (dt_s / 2)) * dt_s
        self._covariance = transition @ self._covariance @ transition.T
        self._covariance[0, 0] += (config.acceleration_noise * dt_s) ** 2
        self._covariance[feet, feet] += (config.foot_drift_noise * dt_s) ** 2 * noise

    def _correct(self, velocity: np.ndarray, place: np.ndarray, noise: np.ndarray) -> None:
        """Kalman's correction: gain P (P + R)^-1, since the state itself is measured.

        Every leg measures v. All of them together are one measurement: their mean, weighted by the inverse of
        their variances, whose inverse variance is the sum of these.

        Args:
            velocity: (legs, 3) m/s, measurements of v.
            place: (legs, 3) m, measurements of r, each of its own leg.
            noise: (legs,) factor on the variance of each leg's measurement of v.
        """
        certainty = 1.0 / (self._config.foot_velocity_noise**2 * noise)
        total = certainty.sum()
        innovation = -self._state
        innovation[0] += certainty @ velocity / total
        innovation[1:] += place
        measured = self._covariance + self._place_noise
        measured[0, 0] += 1.0 / total
        gain = np.linalg.solve(measured, self._covariance).T
        self._state += gain @ innovation
        covariance = self._covariance - gain @ self._covariance
        self._covariance = (covariance + covariance.T) / 2

    def _height_above(self, feet: np.ndarray, trust: np.ndarray) -> float:
        """Height of the IMU above the mean of feet (legs, 3), weighted by trust (legs,)."""
        return -float(feet[:, 2] @ trust / trust.sum())
