"""Controllers for following a path and reaching a pose: from odometry to a velocity command.

The velocity along the path is fed forward, the distance from it is corrected proportionally, and the robot
turns to the direction of the path a little farther ahead. This is the kinematic tracking law of Kanayama et
al. (1990), "A stable tracking control method for an autonomous mobile robot", extended by the sideways
velocity that legs have and wheels lack. Its reference is the nearest point of the path instead of a point
that moves with time: a robot that was held up does not have to catch up.
"""

import math
from dataclasses import dataclass

import numpy as np

from footfall.common.config import require_between
from footfall.deploy.command_source import Pose
from footfall.operate.abilities import Limits
from footfall.operate.missions.path import SPACING_M, Path

SEARCH_SAMPLES = round(0.3 / SPACING_M)  # number of samples ahead among which the nearest one is searched


@dataclass(frozen=True)
class Tracking:
    """Gains and tolerances of following, and when to give up."""

    position_gain: float = 1.0  # m/s per metre of error
    heading_gain: float = 1.5  # rad/s per radian of error
    deceleration_m_s2: float = 0.4  # before corners and the end
    tolerance_m: float = 0.02  # at the end
    tolerance_deg: float = 4.0  # at the end
    off_path_m: float = 0.5  # distance from the path beyond which the mission gives up
    blocked_s: float = 8.0  # time without progress after which the mission gives up

    def __post_init__(self) -> None:
        require_between(self, 0.05, 10.0, "position_gain", "heading_gain", "deceleration_m_s2")
        require_between(self, 0.001, 10.0, "tolerance_m", "off_path_m")
        require_between(self, 0.1, 90.0, "tolerance_deg")
        require_between(self, 0.5, 600.0, "blocked_s")


def nearest(path: Path, pose: Pose, begin: int) -> tuple[int, float]:
    """Index of the nearest sample from `begin` on, and its distance in m."""
    offsets = path.points[begin : begin + SEARCH_SAMPLES] - (pose.x_m, pose.y_m)
    squared_distances = np.einsum("ij,ij->i", offsets, offsets)
    index = int(squared_distances.argmin())
    return begin + index, math.sqrt(squared_distances[index])


def command_along(path: Path, index: int, pose: Pose, limits: Limits, tracking: Tracking) -> np.ndarray:
    """The command (3,) for following a path whose nearest sample is `index`."""
    speed, heading = float(path.speed[index]), float(path.heading[index])
    # Without looking ahead, the heading would lag in a bend.
    look_ahead = index + round(speed / tracking.heading_gain / SPACING_M)
    turn_rad = float(path.heading[min(look_ahead, len(path.heading) - 1)]) - pose.yaw_rad
    speed *= max(0.0, math.cos(turn_rad)) ** 2  # turn first, then walk
    x, y = path.points[index].tolist()
    gain = tracking.position_gain
    x_m_s = speed * math.cos(heading) + gain * (x - pose.x_m)
    y_m_s = speed * math.sin(heading) + gain * (y - pose.y_m)
    return command_of_velocity(x_m_s, y_m_s, tracking.heading_gain * turn_rad, pose, limits)


def command_towards(goal: Pose, pose: Pose, limits: Limits, tracking: Tracking) -> np.ndarray:
    """The command (3,) for going straight to a pose while turning."""
    gain = tracking.position_gain
    yaw_rad_s = tracking.heading_gain * (goal.yaw_rad - pose.yaw_rad)
    return command_of_velocity(
        gain * (goal.x_m - pose.x_m), gain * (goal.y_m - pose.y_m), yaw_rad_s, pose, limits
    )


def distance(first: Pose, second: Pose) -> float:
    """Distance between two positions, m."""
    return math.hypot(first.x_m - second.x_m, first.y_m - second.y_m)


def arrived(goal: Pose, pose: Pose, tracking: Tracking) -> bool:
    """Whether a pose has been reached."""
    turn_rad = abs(goal.yaw_rad - pose.yaw_rad)
    return distance(goal, pose) <= tracking.tolerance_m and turn_rad <= math.radians(tracking.tolerance_deg)


def command_of_velocity(
    x_m_s: float, y_m_s: float, yaw_rad_s: float, pose: Pose, limits: Limits
) -> np.ndarray:
    """Convert a velocity to a command (3,) in the body frame, within a policy's limits.

    Clipping the speed keeps the direction. A command with a smaller norm than the limits' is scaled up to it.

    Args:
        x_m_s, y_m_s: velocity in the frame in which `pose` is given.
        yaw_rad_s: yaw rate.
        pose: pose of the robot.
        limits: limits of the policy.
    """
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    ahead, left = cos * x_m_s + sin * y_m_s, cos * y_m_s - sin * x_m_s
    ranges = limits.ranges
    share = min(_share(ahead, ranges.forward_m_s), _share(left, ranges.leftward_m_s))
    low, high = ranges.yaw_rad_s
    result = np.array([share * ahead, share * left, min(max(yaw_rad_s, low), high)])
    norm = math.sqrt(result @ result)
    return result * (limits.min_norm / norm) if 0.0 < norm < limits.min_norm else result


def _share(value: float, limits: tuple[float, float]) -> float:
    """Largest factor up to 1 that brings a value within limits."""
    limit = limits[1] if value > 0.0 else limits[0]
    return min(1.0, limit / value) if value else 1.0
