"""Paths on the ground as samples: position, heading, maximum speed, remaining time."""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from footfall.deploy.command_source import Pose

SPACING_M = 0.02
YAW_SHARE = 0.8  # of the maximum yaw rate, for bends; the rest is for corrections


class Pace(NamedTuple):
    """Speeds for following a path."""

    speed_m_s: float  # on a straight line
    creep_m_s: float  # minimum, around corners and at the end
    yaw_rad_s: float  # maximum
    deceleration_m_s2: float


class Path(NamedTuple):
    """Samples of a path, about `SPACING_M` apart."""

    points: np.ndarray  # (n, 2) m
    heading: np.ndarray  # (n,) rad, not wrapped: direction to the next sample; last: the final heading
    speed: np.ndarray  # (n,) m/s, maximum
    remaining_s: np.ndarray  # (n,) time to the end, including turns

    @property
    def end(self) -> Pose:
        """Final pose of the robot."""
        x_m, y_m = self.points[-1].tolist()
        return Pose(x_m, y_m, float(self.heading[-1]))


def rectangle(length_m: float, width_m: float) -> np.ndarray:
    """Corners (5, 2) of a rectangle: ahead first, then left, or right for a negative width."""
    return np.array([[0, 0], [length_m, 0], [length_m, width_m], [0, width_m], [0, 0]], dtype=float)


def circle(radius_m: float) -> np.ndarray:
    """Points (n, 2) of a circle that starts ahead and bends left, or right for a negative radius."""
    count = max(16, math.ceil(2 * math.pi * abs(radius_m) / SPACING_M))
    angle = np.linspace(0.0, 2 * math.pi, count + 1)
    return np.stack([abs(radius_m) * np.sin(angle), radius_m * (1.0 - np.cos(angle))], axis=1)


def placed(points: np.ndarray, pose: Pose) -> np.ndarray:
    """Transform points (n, 2) from the frame of a pose to the pose's reference frame."""
    cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
    return np.array([pose.x_m, pose.y_m]) + points @ np.array([[cos, sin], [-sin, cos]])


def sample(corners: np.ndarray, yaw: float, end_yaw: float | None, pace: Pace) -> Path:
    """Create the path along straight lines.

    Args:
        corners: (k, 2) m, k of 2 or more, consecutive ones different.
        yaw: the robot's heading at the start, rad; the path's headings continue it without jumps of full
            turns.
        end_yaw: its heading at the end, up to full turns; None for the last line's direction.
        pace: speeds.
    """
    points = _resampled(corners)
    segments = np.diff(points, axis=0)
    spacing = np.linalg.norm(segments, axis=1)
    headings = np.unwrap(np.append(yaw, np.arctan2(segments[:, 1], segments[:, 0])))[1:]
    end_turn = 0.0 if end_yaw is None else math.remainder(end_yaw - headings[-1], 2 * math.pi)
    turn = np.append(np.abs(np.diff(headings)), abs(end_turn))  # at the end of each line between samples
    speed = np.full(len(points), pace.speed_m_s)
    speed[1:] = np.minimum(speed[1:], YAW_SHARE * pace.yaw_rad_s * spacing / np.maximum(turn, 1e-9))
    speed[-1] = 0.0
    speed = _braked(np.maximum(speed, pace.creep_m_s), spacing, pace.deceleration_m_s2)
    # The robot turns in bends while walking and in corners while standing: the longer of both times counts.
    duration_s = np.maximum(spacing / speed[:-1], turn / pace.yaw_rad_s)
    remaining_s = np.append(np.cumsum(duration_s[::-1])[::-1], 0.0)
    return Path(points, np.append(headings, headings[-1] + end_turn), speed, remaining_s)


def _resampled(corners: np.ndarray) -> np.ndarray:
    """Points along the lines between corners, including the corners."""
    parts = []
    for begin, end in pairwise(corners):
        count = max(1, round(float(np.linalg.norm(end - begin)) / SPACING_M))
        parts.append(begin + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (end - begin))
    return np.concatenate([*parts, corners[-1:]])


def _braked(speed: np.ndarray, spacing: np.ndarray, deceleration_m_s2: float) -> np.ndarray:
    """Reduce speeds (n,) so that braking to each later one is possible: v^2 = v_later^2 + 2 a distance."""
    energy = 2.0 * deceleration_m_s2 * np.append(0.0, np.cumsum(spacing))
    return np.sqrt(np.minimum.accumulate((speed**2 + energy)[::-1])[::-1] - energy)
