"""Attitude filter and base estimator on a recording of a walking iCub, with one set of settings.

    pip install h5py
    python benchmarks/icub_estimation.py --data FOLDER

FOLDER holds `walking.mat`, `com-sinusoid.mat` and `model.urdf` of github.com/ami-iit, repository
paper_ramadoss-2022-iros-humanoid-base-estimation (BSD-3). The estimator reads gyro, accelerometer, encoders
of the legs and vertical forces at the feet, and estimates contacts, attitude, velocity and position. Joint
velocities are differences of positions. The recording's time stamps jitter, so their mean period is used.

Prints the errors against the recorded pose of the base. The reference velocity is the slope of its position
over 0.11 s. In the reference, standing feet creep by 5 to 20 mm.
"""

import argparse
import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
from icub_robot import icub, imu_rotation

from footfall.common.config import structure
from footfall.common.rotations import heading_matrix, rotation_matrix
from footfall.deploy.estimation.attitude import AttitudeEstimator
from footfall.deploy.estimation.config import EstimatorConfig
from footfall.deploy.estimation.estimator import BaseEstimator
from footfall.policies.policy import Sensed
from footfall.robots.description import Robot

RECORDINGS = ("walking", "com-sinusoid")
LEGS = slice(14, 26)  # of the recorded joints: neck, torso, arms, then left and right leg
REST_SAMPLES = 300  # first samples, at rest: their mean is the default pose
SETTINGS = {  # the robot's encoders and accelerometer are accurate, its feet land with hard impacts
    "own_attitude": True,
    "filter": {
        "leg_velocity_noise": 0.01,
        "acceleration_noise": 0.25,
        "acceleration_bias_drift": 0.03,
        "push_m_s": 1.0,
    },
}
SLOPE = 5  # samples on either side, for the slope that gives the reference velocity
MOVING_M_S = 0.05  # horizontal speed of the reference above which the robot counts as moving


class Recording(NamedTuple):
    """The samples of a recording at a constant period, in base axes."""

    robot: Robot
    period_s: float
    gyro: np.ndarray  # (T, 3) rad/s
    acceleration: np.ndarray  # (T, 3) m/s^2
    joint_position: np.ndarray  # (T, 12) rad
    force: np.ndarray  # (T, 2) at the feet, N
    position: np.ndarray  # (T, 3) reference position of the base, m
    rotation: np.ndarray  # (T, 3, 3) reference, body to world


class Estimated(NamedTuple):
    """Outputs of the estimator, from its first sample on."""

    first: int  # sample at which it starts
    position: np.ndarray  # (T, 3) position of the base, m, axes of the base at the start, z up
    velocity: np.ndarray  # (T, 3) m/s, body frame
    rotation: np.ndarray  # (T, 3, 3)
    yaw: np.ndarray  # (T,) rad


def read(folder: Path, name: str, work: Path) -> Recording:
    """Read one recording, with a robot folder under `work`."""
    import h5py

    with h5py.File(folder / f"{name}.mat") as file:
        columns = {
            key: np.array(file[key]).T
            for key in ("imuOmega", "imuAcc", "estimatorJointsPos", "linkBasePos", "linkBaseRot")
        }
        times = np.array(file["estimatorJointsTime"])[0]
        force = np.stack([np.array(file[key])[0] for key in ("lfForceZ", "rfForceZ")], axis=1)
    position = columns["estimatorJointsPos"][:, LEGS]
    robot = icub(folder / "model.urdf", position[:REST_SAMPLES].mean(axis=0), work)
    to_base = imu_rotation(robot).T  # for row vectors
    return Recording(
        robot,
        float(times[-1] - times[0]) / (len(times) - 1),
        columns["imuOmega"] @ to_base,
        columns["imuAcc"] @ to_base,
        position,
        force,
        columns["linkBasePos"],
        np.array([from_angles(*angles) for angles in columns["linkBaseRot"]]),
    )


def from_angles(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Rotation of roll, pitch and yaw, (3, 3)."""
    (cx, sx), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch))
    tilted = np.array([[cy, sy * sx, sy * cx], [0.0, cx, -sx], [-sy, cy * sx, cy * cx]])
    return heading_matrix(yaw) @ tilted


def estimate(recording: Recording) -> Estimated:
    """Run attitude filter and base estimator on a recording."""
    config = structure(SETTINGS, EstimatorConfig, "SETTINGS")
    attitude_filter, estimator = AttitudeEstimator(config.attitude), BaseEstimator(recording.robot, config)
    velocity = (
        np.diff(recording.joint_position, axis=0, prepend=recording.joint_position[:1]) / recording.period_s
    )
    first, odometry = None, []
    for sample, (gyro, acceleration) in enumerate(zip(recording.gyro, recording.acceleration, strict=True)):
        elapsed_s = recording.period_s if sample else 0.0
        attitude = attitude_filter.update(gyro.tolist(), acceleration.tolist(), elapsed_s)
        if attitude is None:
            continue
        sensed = Sensed(
            gyro,
            acceleration,
            np.array(attitude.quaternion),
            recording.joint_position[sample],
            velocity[sample],
            np.full(velocity.shape[1], np.nan),
            recording.force[sample],
        )
        if first is None:
            first = sample
            estimator.reset(sensed)
        else:
            estimator.update(sensed, None, elapsed_s)
        odometry.append(estimator.odometry())
    if first is None:
        raise SystemExit("the robot does not keep still at first: no attitude")
    return Estimated(
        first,
        np.array([each.position for each in odometry]),
        np.array([each.velocity for each in odometry]),
        np.array([rotation_matrix(each.orientation) for each in odometry]),
        np.unwrap([each.yaw for each in odometry]),
    )


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


def slope(position: np.ndarray, period_s: float) -> np.ndarray:
    """Velocity (T - 2 SLOPE, 3) of positions (T, 3): least squares over each 2 SLOPE + 1 samples."""
    steps = np.arange(-SLOPE, SLOPE + 1)
    weights = steps / (np.sum(steps**2) * period_s)
    windows = np.lib.stride_tricks.sliding_window_view(position, len(steps), axis=0)
    result: np.ndarray = windows @ weights
    return result


def figures(recording: Recording, estimated: Estimated) -> dict[str, str]:
    """Errors, by name, with their units."""
    position, rotation = recording.position[estimated.first :], recording.rotation[estimated.first :]
    to_start = heading_matrix(-math.atan2(rotation[0, 1, 0], rotation[0, 0, 0]))
    end_error = estimated.position[-1] - to_start @ (position[-1] - position[0])
    inner = slice(SLOPE, -SLOPE)
    true = slope(position, recording.period_s)
    velocity_error = estimated.velocity[inner] - np.einsum("tji,tj->ti", rotation[inner], true)
    tilt_error = np.degrees(np.linalg.norm(estimated.rotation[:, 2] - rotation[:, 2], axis=1))
    yaw = np.unwrap(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]))
    moving = np.flatnonzero(np.linalg.norm(true[:, :2], axis=1) > MOVING_M_S)
    in_motion = tilt_error[inner][moving[0] : moving[-1] + 1] if len(moving) else tilt_error
    return {
        "distance": f"{1e3 * np.linalg.norm((position[-1] - position[0])[:2]):.0f} mm",
        "position error at the end": f"{1e3 * np.linalg.norm(end_error[:2]):.0f} mm",
        "velocity RMSE x, y, z": ", ".join(f"{1e3 * rms(axis):.0f}" for axis in velocity_error.T) + " mm/s",
        "tilt RMS, all / in motion": f"{rms(tilt_error):.2f} / {rms(in_motion):.2f} degrees",
        "largest tilt error": f"{tilt_error.max():.1f} degrees",
        "yaw error at the end": f"{np.degrees(estimated.yaw[-1] - yaw[-1] + yaw[0]):.1f} degrees",
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", type=Path, required=True, help="folder of the recordings")
    options = parser.parse_args()
    for name in RECORDINGS:
        if not (options.data / f"{name}.mat").is_file():
            parser.error(f"{options.data} holds no {name}.mat")
        with tempfile.TemporaryDirectory() as work:
            recording = read(options.data, name, Path(work))
            print(name)
            for figure, value in figures(recording, estimate(recording)).items():
                print(f"  {figure}: {value}")


if __name__ == "__main__":
    main()
