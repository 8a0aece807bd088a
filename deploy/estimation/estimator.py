"""Motion and pose of the base from IMU, joints and contacts, for any number of limbs."""

import math

import numpy as np

from footfall.common.rotations import heading_matrix, multiply, rotation_matrix, skew, skews, wrap_angle
from footfall.deploy.estimation.attitude import Attitude, advanced, initial_attitude, leveled
from footfall.deploy.estimation.config import EstimatorConfig
from footfall.deploy.estimation.contact import ContactEstimator
from footfall.deploy.estimation.feet import ContactPoints
from footfall.deploy.estimation.filter import MotionFilter
from footfall.deploy.estimation.gyro import GyroBias
from footfall.deploy.estimation.height import StanceHeight
from footfall.deploy.estimation.odometry import (
    POSITION,
    VELOCITY,
    DelayUncertainty,
    Odometry,
    PoseUncertainty,
)
from footfall.deploy.estimation.sensor_notes import SensorNotes
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot
from footfall.robots.model import imu_position
from footfall.robots.rigid_body import nominal_body


class BaseEstimator:
    """Estimates the base's motion and pose from readings.

    Args:
        robot: robot with nominal geometry and masses; the plant's are not used.
        config: noise parameters.
    """

    def __init__(self, robot: Robot, config: EstimatorConfig | None = None) -> None:
        self._config = config or EstimatorConfig()
        self._legs = robot.legs
        self._imu_position = imu_position(robot)
        self._contact_points = ContactPoints(self._legs, self._config.contact.level_m)
        self._sensor_notes = SensorNotes(robot, self._config.contact.sensor_trial_s)
        self._height = StanceHeight(self._legs.foot_radius, self._config.odometry.height_filter_s)
        self._contact = ContactEstimator(self._legs, nominal_body(robot), self._config.contact)
        self._gyro = GyroBias(self._config.gyro)
        self.motion = MotionFilter(self._config.filter)
        self._pose_uncertainty = PoseUncertainty(self._config.odometry)
        self._delay_uncertainty = DelayUncertainty(self._config.odometry)

    @property
    def notes(self) -> list[str]:
        """Notes on force sensors that are not used, without repetition."""
        return self._sensor_notes.notes

    def reset(self, sensed: Sensed) -> None:
        """Start at rest, with all feet in contact and a pose of zero."""
        self._contact.reset(sensed)
        self._gyro.reset()
        self.motion.reset()
        self._delay_uncertainty.reset()
        self._velocity, self._angular_velocity, self._quaternion = np.zeros(3), sensed.gyro, sensed.quaternion
        self._attitude: Attitude | None = None
        if self._config.own_attitude:
            self._attitude = initial_attitude(
                sensed.quaternion.tolist(), sensed.gyro.tolist(), self._config.attitude
            )
        self._update_kinematics(sensed)
        self._height.reset(self._points_from_imu, self._up)
        self._sensor_notes.reset()
        self.start()

    def start(self) -> None:
        """Set the pose to zero and keep the estimated motion."""
        self.motion.set_position((self._rotation @ self._imu_position).tolist())
        self._pose_uncertainty.reset()
        self._start_yaw = self._yaw()
        self._start_height = self._base_height()

    def stood_up(self, sensed: Sensed) -> None:
        """Start again at rest after a fall, with all feet in contact, at the position of the fall and the
        IMU's yaw."""
        position = np.array(self.motion.position) - self._rotation @ self._imu_position
        kept = self._start_yaw, self._start_height, self._pose_uncertainty
        self._pose_uncertainty = PoseUncertainty(self._config.odometry)  # because `reset` starts a new one
        self.reset(sensed)
        self._start_yaw, self._start_height, self._pose_uncertainty = kept
        self._pose_uncertainty.add_fall()
        self.motion.set_position((position + self._rotation @ self._imu_position).tolist())

    def update(self, sensed: Sensed, stance: np.ndarray | None, dt_s: float) -> tuple[np.ndarray, float]:
        """Update with one set of readings.

        Args:
            sensed: the readings.
            stance: (legs,) planned contact in [0, 1], or None without a plan.
            dt_s: time since the previous readings.

        Returns:
            Velocity of the base's origin in the body frame, (3,) m/s, and its height above the centre of the
            mean stance foot, m.
        """
        self._angular_velocity = np.array(
            self._gyro.update(sensed.gyro.tolist(), sensed.quaternion.tolist(), dt_s)
        )
        self._orient(sensed, dt_s)
        jacobian = self._update_kinematics(sensed)
        rotation, rows, across = self._rotation, self._rotation.tolist(), skew(self._angular_velocity).T
        rates = self._legs.gather(sensed.joint_velocity)
        contact = self._contact.update(sensed, rates, jacobian, self._up, stance, dt_s)
        if len(sensed.foot_force):
            self._sensor_notes.update(~self._contact.trusted, dt_s)
        # Velocity of the contact points relative to the IMU, body frame.
        contact_velocity = (jacobian @ rates[:, :, None])[:, :, 0] + self._points_from_imu.dot(across)
        self.motion.predict(sensed.acceleration.tolist(), rows, dt_s)
        self.motion.correct(contact_velocity.dot(-rotation.T).tolist(), contact, rows, dt_s)
        if self._attitude is not None:
            self._attitude, bias = leveled(self._attitude, self.motion.bias, self._config.attitude)
            self.motion.bias = list(bias)
        self._height.update(self._points_from_imu, self._up, contact, self.motion, dt_s)
        self._pose_uncertainty.advance(self.motion.velocity, dt_s)
        self._delay_uncertainty.advance(self.motion.velocity, dt_s)
        self._velocity = np.array(self.motion.velocity).dot(rotation) - self._imu_position.dot(across)
        return self._velocity, self._base_height()

    def pose(self) -> tuple[float, float, float]:
        """x m, y m and yaw rad of the base since the start, in the frame of `Odometry`."""
        x, y, _ = (np.array(self.motion.position) - self._rotation @ self._imu_position).tolist()
        cos, sin = math.cos(self._start_yaw), math.sin(self._start_yaw)
        yaw = wrap_angle(self._yaw() - self._start_yaw)
        return cos * x + sin * y, cos * y - sin * x, yaw

    def odometry(self) -> Odometry:
        """Complete estimate, with its covariance."""
        config, motion = self._config.odometry, self.motion
        position = np.array(motion.position) - self._rotation @ self._imu_position
        covariance = np.zeros((7, 7))
        covariance[:4, :4] = self._pose_uncertainty.covariance(position)
        covariance[POSITION, POSITION] += motion.pp * np.eye(3)
        covariance[POSITION, VELOCITY] = covariance[VELOCITY, POSITION] = motion.pv * np.eye(3)
        foot_noise = np.diag([config.creep_m_s, config.creep_m_s, config.sink_m_s]) ** 2
        covariance[VELOCITY, VELOCITY] = (
            motion.vv * np.eye(3) + foot_noise + self._delay_uncertainty.covariance
        )
        if config.level_ground:
            position[2] = self._base_height() - self._start_height
            covariance[2] = covariance[:, 2] = 0.0
            covariance[2, 2] = config.height_noise**2 + self._height.deviation**2
        to_odometry = np.eye(7)
        to_odometry[POSITION, POSITION] = heading_matrix(-self._start_yaw)
        to_odometry[VELOCITY, VELOCITY] = self._rotation.T
        return Odometry(
            position=to_odometry[POSITION, POSITION] @ position,
            orientation=multiply(_about_vertical(-self._start_yaw), self._quaternion),
            yaw=wrap_angle(self._yaw() - self._start_yaw),
            velocity=self._velocity,
            angular_velocity=self._angular_velocity,
            height=self._base_height(),
            contact=np.array(self._contact.probability),
            covariance=to_odometry @ covariance @ to_odometry.T,
        )

    def _orient(self, sensed: Sensed, dt_s: float) -> None:
        """Update the orientation: the IMU's, or the estimator's own, from the angular velocity."""
        self._quaternion = sensed.quaternion
        if self._attitude is not None and dt_s > 0.0:
            gx, gy, gz = self._angular_velocity.tolist()
            ax, ay, az = sensed.acceleration.tolist()
            self._attitude = advanced(self._attitude, (gx, gy, gz), (ax, ay, az), dt_s, self._config.attitude)
            self._quaternion = np.array(self._attitude.quaternion)
            self._angular_velocity = self._angular_velocity - self._attitude.bias

    def _update_kinematics(self, sensed: Sensed) -> np.ndarray:
        """Update positions and rotation; returns the Jacobians of the contact points, (legs, 3, m)."""
        self._rotation = rotation_matrix(self._quaternion)
        self._up = up = self._rotation[2]
        pose = self._legs.pose(sensed.joint_position)
        arms = self._contact_points.arms(sensed.joint_position, up)
        self._points_from_imu = pose.foot + arms - self._imu_position
        if self._contact_points.spherical:
            return pose.jacobian + self._legs.rolling_offset(pose.axes, up)
        return pose.jacobian - skews(arms) @ pose.axes  # axis x arm

    def _base_height(self) -> float:
        return self._height.value - float(self._up.dot(self._imu_position))

    def _yaw(self) -> float:
        return math.atan2(self._rotation[1, 0], self._rotation[0, 0])


def _about_vertical(angle: float) -> np.ndarray:
    """Quaternion (4,) of a rotation about the vertical."""
    return np.array([math.cos(angle / 2), 0.0, 0.0, math.sin(angle / 2)])
