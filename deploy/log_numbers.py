"""Policy inputs and odometry as vectors of numbers, for a log."""

import numpy as np

from footfall.deploy.estimation.odometry import VELOCITY, YAW, Odometry
from footfall.policies.policy import PolicyInput, Sensed
from footfall.robots.readings import sensed_sizes

_POSITION_AND_YAW = [0, 1, 2, 5]  # indices of x, y, z and yaw in (x, y, z, roll, pitch, yaw)


def flatten(inputs: PolicyInput) -> np.ndarray:
    """Policy input as one float64 vector: time, readings in field order, command, velocity, height.

    A height scan, if any, comes last.
    """
    scan = () if inputs.height_scan is None else (inputs.height_scan,)
    return np.concatenate(
        [
            [inputs.time_s],
            *inputs.sensed,
            inputs.command,
            inputs.base_velocity,
            [inputs.base_height],
            *scan,
        ]
    )


def input_sizes(joints: int, foot_sensors: int = 0) -> dict[str, int]:
    """Number of components of each part of a flat policy input, in order, without a height scan."""
    sensed = sensed_sizes(joints, foot_sensors)
    return {"time_s": 1, **sensed, "command": 3, "base_velocity": 3, "base_height": 1}


def unflatten(values: np.ndarray, joints: int, scan_points: int = 0, foot_sensors: int = 0) -> PolicyInput:
    """Policy input from a vector by `flatten`, which may end with a height scan of `scan_points` points.

    Raises:
        ValueError: the length does not match the robot's readings or the height scan.
    """
    sizes = list(input_sizes(joints, foot_sensors).values())
    if len(values) - sum(sizes) not in (0, scan_points):
        raise ValueError(f"{len(values)} numbers do not match the policy input of {joints} joints")
    time_s, *rest, scan = np.split(values, np.cumsum(sizes))
    *sensed, command, velocity, height = rest
    height_scan = scan if len(scan) else None
    return PolicyInput(float(time_s[0]), Sensed(*sensed), command, velocity, float(height[0]), height_scan)


def odometry_numbers(odometry: Odometry) -> np.ndarray:
    """Numbers of a nav_msgs/Odometry, (85,): see `messages.odometry`.

    Covariances of roll, pitch and angular velocity are zero: they are not estimated.
    """
    w, x, y, z = odometry.orientation
    pose, twist = np.zeros((6, 6)), np.zeros((6, 6))
    pose[np.ix_(_POSITION_AND_YAW, _POSITION_AND_YAW)] = odometry.covariance[: YAW + 1, : YAW + 1]
    twist[:3, :3] = odometry.covariance[VELOCITY, VELOCITY]
    return np.concatenate(
        [
            odometry.position,
            [x, y, z, w],
            pose.ravel(),
            odometry.velocity,
            odometry.angular_velocity,
            twist.ravel(),
        ]
    )
