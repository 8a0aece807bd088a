"""Writes a recording of any robot as a log, with the results of attitude filter and base estimator."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from footfall.common.errors import UserError
from footfall.deploy.base_estimate import ODOMETRY_EVERY_US
from footfall.deploy.clock import LOCKSTEP_START_NS
from footfall.deploy.estimation.attitude import AttitudeEstimator
from footfall.deploy.estimation.config import AttitudeConfig, EstimatorConfig
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.deploy.log import McapLog
from footfall.deploy.log_analysis.columns import RECORDED_BUS
from footfall.deploy.log_analysis.recorded_csv import Recorded
from footfall.deploy.modes import Mode
from footfall.deploy.receiver import MotorHealth
from footfall.deploy.safety import State
from footfall.policies.policy import PolicyInput, Sensed
from footfall.robots.actuator import JointCommand
from footfall.robots.description import Robot

UNIX_TIME_S = 1e8  # a first time above this is a Unix time


class Imported(NamedTuple):
    """Content of a log."""

    readings: int
    duration_s: float
    attitude: str  # source of the attitude
    estimated: bool  # whether the log has the base's estimated motion
    commanded: bool  # whether the log has the joints' commands


class _Recording:
    """Placeholder for the policy of a recording, which is unknown."""

    name = "recording"
    rate_hz = 50.0
    needs_estimate = False
    contract = None
    notes: tuple[str, ...] = ()

    def reset(self, inputs: PolicyInput) -> None:
        raise NotImplementedError

    def act(self, inputs: PolicyInput) -> JointCommand:
        raise NotImplementedError

    def stance(self) -> None:
        return None


def import_recording(
    recorded: Recorded, robot: Robot, config: EstimatorConfig, out: Path, source: str
) -> Imported:
    """Write a recording as a log.

    Contacts and motion of the base are estimated from an IMU with forces at the feet or joint torques.
    Unknown torques are NaN in the log. Without an IMU, the base is at rest.

    Args:
        recorded: the readings.
        robot: robot of the readings.
        config: settings of attitude filter and base estimator.
        out: log file to write.
        source: source of the readings, stored in the log.

    Raises:
        UserError: the log cannot be written, or the robot is never at rest in a recording without
            orientation.
    """
    quaternion = recorded.quaternion
    if quaternion is None:
        quaternion = attitudes(recorded, config.attitude)
    torque, estimator = recorded.torque, None
    if torque is None:
        torque = np.full_like(recorded.position, np.nan)
    if recorded.imu and (recorded.torque is not None or recorded.force is not None):
        estimator = BaseEstimator(robot, config)
    log = McapLog(out, robot, _Recording(), {"bus": RECORDED_BUS, "recording": source}, may_wait=True)
    try:
        is_unix_time = recorded.start_s > UNIX_TIME_S
        log.begin(round(1e9 * recorded.start_s) if is_unix_time else LOCKSTEP_START_NS)
        log.state(0, State(Mode.WALKING))
        n = len(robot.joint_names)
        health = MotorHealth(np.zeros(n + 1), np.full(n, np.nan), np.full(n, np.nan), np.zeros(n))
        previous_us, next_us = 0, 0
        for row, now_us in enumerate(recorded.time_us.tolist()):
            sensed = Sensed(
                recorded.gyro[row],
                recorded.acceleration[row],
                quaternion[row],
                recorded.position[row],
                recorded.velocity[row],
                torque[row],
            )
            log.tick(now_us, sensed, health, None if recorded.command is None else recorded.command[row])
            if estimator is None:
                continue
            if recorded.force is not None:
                sensed = sensed._replace(foot_force=recorded.force[row])
            if row:
                estimator.update(sensed, None, 1e-6 * (now_us - previous_us))
            else:
                estimator.reset(sensed)
            previous_us = now_us
            if now_us >= next_us:
                next_us = now_us + ODOMETRY_EVERY_US
                log.odometry(now_us, estimator.odometry())
    finally:
        missing_parts = log.close()
    if missing_parts:
        raise UserError(missing_parts)
    duration_s = 1e-6 * float(recorded.time_us[-1])
    attitude = "as recorded" if recorded.quaternion is not None else "from gyro and accelerometer"
    if not recorded.imu:
        attitude = "of a base at rest"
    commanded = recorded.command is not None
    return Imported(len(quaternion), duration_s, attitude, estimator is not None, commanded)


def attitudes(recorded: Recorded, config: AttitudeConfig) -> np.ndarray:
    """Orientations (T, 4) from gyro and accelerometer; before the filter starts, its first orientation.

    Raises:
        UserError: the robot is not at rest long enough.
    """
    estimator, found = AttitudeEstimator(config), []
    steps_s = 1e-6 * np.diff(recorded.time_us, prepend=recorded.time_us[:1])
    for gyro, acceleration, elapsed_s in zip(
        recorded.gyro.tolist(), recorded.acceleration.tolist(), steps_s.tolist(), strict=True
    ):
        if (attitude := estimator.update(gyro, acceleration, elapsed_s)) is not None:
            found.append(attitude.quaternion)
    if not found:
        raise UserError(
            f"the robot is never at rest for {config.rest_s:g} s: without a quaternion in the map, its"
            f" attitude begins at rest, with a gyro below {config.rest_rad_s:g} rad/s (estimator.attitude)"
        )
    return np.array([found[0]] * (len(steps_s) - len(found)) + found)
