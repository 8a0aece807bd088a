"""The result of an episode, with samples of the walking phase at a fixed rate."""

from dataclasses import dataclass

import numpy as np

from footfall.deploy.session import SessionResult


@dataclass(frozen=True)
class Trace(SessionResult):
    """T samples of the walking phase: ground truth, except estimates, commands and targets."""

    fell: bool
    fall_reason: str  # empty if the robot did not fall
    distance_m: float  # see plant.progress
    mean_velocity: np.ndarray  # (3,) m/s, body frame
    record_rate_hz: float
    time_s: np.ndarray  # (T,) since walking began
    command: np.ndarray  # (T, 3) forward m/s, leftward m/s, yaw rad/s, before limits
    base_position: np.ndarray  # (T, 3) m, world
    base_quaternion: np.ndarray  # (T, 4) w x y z, body to world
    base_velocity: np.ndarray  # (T, 3) m/s, body frame
    base_angular_velocity: np.ndarray  # (T, 3) rad/s, body frame
    joint_position: np.ndarray  # (T, n) rad
    joint_velocity: np.ndarray  # (T, n) rad/s
    motor_torque: np.ndarray  # (T, n) N m at the joint, before gearbox friction
    joint_target: np.ndarray  # (T, n) rad, position targets that were sent
    foot_position: np.ndarray  # (T, feet, 3) m, world
    foot_contact: np.ndarray  # (T, feet) bool
    foot_velocity: np.ndarray  # (T, feet, 3) m/s, world
    foot_force: np.ndarray  # (T, feet) N, normal
    legs_touch: np.ndarray  # (T,) bool, two different legs press on each other
    qpos: np.ndarray  # (T, nq) of the plant's model, for rendering
    estimated_velocity: np.ndarray  # (T, 3) m/s, body frame; NaN without an estimator
    estimated_height: np.ndarray  # (T,) m
    electrical_power: np.ndarray  # (T,) W, mean since the previous sample: shaft power and copper loss
    mechanical_power: np.ndarray  # (T,) W, mean
    positive_power: np.ndarray  # (T,) W, mean of each motor's power where it is positive
