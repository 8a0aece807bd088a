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

from footfall.common.rotations import normalised, rotation_matrix, skew
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot
from footfall.robots.kinematics import Legs
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
        self._legs = Legs(robot)
        self._imu = imu_position(robot)
        self._diagonal = np.arange(1 + self._legs.count)
        body = nominal_body(robot)
        self._leg_inertia = body.leg_inertia
        self._even_force = -GRAVITY[2] * body.mass / self._legs.count

    def reset(self, sensed: Sensed) -> None:
        """Begin at rest, all feet down."""
        legs = self._legs
        self._momentum = (self._leg_inertia @ legs.gather(sensed.joint_velocity)[:, :, None])[:, :, 0]
        self._outside_torque = -legs.gather(sensed.joint_torque)
        rotation = rotation_matrix(normalised(sensed.quaternion))
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
        rotation = rotation_matrix(normalised(sensed.quaternion))
        pose = legs.pose(sensed.joint_position)
        rolling = legs.rolling_offset(pose.axes, rotation[2])
        contact_jacobian = pose.jacobian + rolling
        rates = legs.gather(sensed.joint_velocity)[:, :, None]

        trust = self._contact(sensed, contact_jacobian, rotation, dt_s)
        if stance is not None:
            trust = trust * stance

        place = pose.foot - self._imu
        lowest = -legs.foot_radius[:, None] * rotation[2]
        turning = skew(sensed.gyro).T
        standing_rate = (contact_jacobian @ rates)[:, :, 0] + (place + lowest) @ turning
        rolling_rate = (rolling @ rates)[:, :, 0] + lowest @ turning
        measured_velocity = -standing_rate @ rotation.T
        measured_place = place @ rotation.T
        foot_velocity = -rolling_rate @ rotation.T  # of a standing foot's centre, in the world

        self._predict(rotation @ sensed.acceleration + GRAVITY, foot_velocity, trust, dt_s)
        self._correct(measured_velocity, measured_place, trust)

        velocity = rotation.T @ self._state[0] - self._imu @ turning
        if trust.sum() > 0.5:
            self._height = self._height_above(self._state[1:], trust)
        else:
            self._height += float(self._state[0, 2]) * dt_s
        return velocity, self._height + float(-rotation[2] @ self._imu)

    def _contact(self, sensed: Sensed, jacobian: np.ndarray, rotation: np.ndarray, dt_s: float) -> np.ndarray:
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
        force = np.linalg.solve(regular, pushed)[:, :, 0] @ rotation[2] / self._even_force
        trust = (force - config.contact_force_low) / (config.contact_force_high - config.contact_force_low)
        return np.minimum(np.maximum(trust, 0.0), 1.0)

    def _noise(self, trust: np.ndarray) -> np.ndarray:
        """Factor on the noise variance of each foot (legs,)."""
        return self._config.swing_noise ** (2.0 - 2.0 * trust)

    def _predict(
        self, acceleration: np.ndarray, foot_velocity: np.ndarray, trust: np.ndarray, dt_s: float
    ) -> None:
        """v' = v + a dt; r' = r + (u - v) dt, where u is the velocity of a foot's centre as it rolls."""
        config = self._config
        state = self._state
        middle = state[0] + acceleration * (dt_s / 2)
        state[1:] += (foot_velocity - middle) * dt_s
        state[0] += acceleration * dt_s
        covariance = self._covariance
        covariance[1:] -= dt_s * covariance[0]
        covariance[:, 1:] -= dt_s * covariance[:, :1]
        covariance[0, 0] += (config.acceleration_noise * dt_s) ** 2
        feet = self._diagonal[1:]
        covariance[feet, feet] += (config.foot_drift_noise * dt_s) ** 2 * self._noise(trust)

    def _correct(self, velocity: np.ndarray, place: np.ndarray, trust: np.ndarray) -> None:
        """Each leg measures v (velocity, (legs, 3)) and its own r (place, (legs, 3)).

        In information form, since every measurement is of one state: the information matrix gains only on
        its diagonal.
        """
        config = self._config
        from_velocity = 1.0 / (config.foot_velocity_noise**2 * self._noise(trust))
        from_place = 1.0 / config.foot_place_noise**2
        information = np.linalg.inv(self._covariance)
        information[0, 0] += from_velocity.sum()
        feet = self._diagonal[1:]
        information[feet, feet] += from_place
        covariance = np.linalg.inv(information)
        pull = np.empty_like(self._state)
        pull[0] = from_velocity @ (velocity - self._state[0])
        pull[1:] = from_place * (place - self._state[1:])
        self._state += covariance @ pull
        self._covariance = (covariance + covariance.T) / 2

    def _height_above(self, feet: np.ndarray, trust: np.ndarray) -> float:
        """Height of the IMU above the mean of feet (legs, 3), weighted by trust (legs,)."""
        return -float(feet[:, 2] @ trust / trust.sum())
