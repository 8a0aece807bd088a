"""Poses of the links, for 3-D views and navigation: frames as in REP 105.

The poses are computed with plain Python numbers, since this process has no NumPy. Each frame is relative to
its parent, so chains of links need not be evaluated.
"""

import math
import struct
from collections.abc import Callable, Sequence
from typing import Any

from footfall.deploy.telemetry.messages import BASE, ODOM, transforms

EVERY_NS = 20_000_000  # 50 Hz, as often as odometry comes
FIXED, PRISMATIC = "fixed", "prismatic"
_POSE = struct.Struct("<7d")  # first numbers of odometry: x, y, z, quaternion x, y, z, w
_QUATERNION = struct.Struct("<4d")

Quaternion = tuple[float, float, float, float]  # w, x, y, z


class Transforms:
    """Publishes `/tf` and `/tf_static`.

    The base's pose in `odom` is that of the odometry. Before the first odometry and after the end of walking,
    its position is the last one (at first the origin), and its orientation is the IMU's, rotated by a
    constant yaw.
    """

    def __init__(self, links: Sequence[dict[str, Any]], put: Callable[[str, int, bytes], None]) -> None:
        """Transforms of some links; none for an empty sequence.

        Args:
            links: each with `name`, `parent`, `kind` of its joint, `index` of that joint among the robot's
                (None without a motor), `position` (3,) m, `quaternion` w, x, y, z of its frame in the
                parent's where the joint is at zero, and `axis` (3,) in its own frame.
            put: takes topic, time in ns, and message.
        """
        children = [link for link in links if link["parent"]]
        self._fixed = [link for link in children if link["kind"] == FIXED or link["index"] is None]
        self._moving = [link for link in children if link not in self._fixed]
        self._frames = ((ODOM, BASE), *((link["parent"], link["name"]) for link in self._moving))
        self._put = put
        self._next_ns = 0
        self._position: tuple[float, float, float] = (0.0, 0.0, 0.0)
        self._yaw_offset: Quaternion | None = None  # rotation from the IMU's heading to that of the odometry
        self._pose: bytes | None = None  # from odometry since the last readings

    def begin(self, time_ns: int) -> None:
        """Publish the constant transforms."""
        if self._fixed:
            frames = tuple((link["parent"], link["name"]) for link in self._fixed)
            poses = [_packed(link["position"], tuple(link["quaternion"])) for link in self._fixed]
            self._put("/tf_static", time_ns, transforms(frames).fill(time_ns, *poses))

    def odometry(self, numbers: bytes) -> None:
        """Set the base's pose from the numbers of a nav_msgs/Odometry."""
        self._pose = numbers[: _POSE.size]

    def readings(self, time_ns: int, positions: bytes, quaternion: bytes) -> None:
        """Publish the poses of the links if due, given joint positions, rad or m, and the IMU's w, x, y,
        z."""
        if not self._moving or time_ns < self._next_ns:
            return
        self._next_ns = time_ns + EVERY_NS
        angles = struct.unpack(f"<{len(positions) // 8}d", positions)
        poses = [_joint_pose(link, angles[link["index"]]) for link in self._moving]
        base = self._base(_QUATERNION.unpack(quaternion))
        self._put("/tf", time_ns, transforms(self._frames).fill(time_ns, base, *poses))

    def _base(self, sensed: Quaternion) -> bytes:
        if self._pose is not None:
            pose, self._pose = self._pose, None
            x, y, z, *xyz, w = _POSE.unpack(pose)
            self._position = x, y, z
            self._yaw_offset = _heading(_product((w, *xyz), _inverse(sensed)))
            return pose
        if self._yaw_offset is None:
            self._yaw_offset = _inverse(_heading(sensed))
        return _packed(self._position, _product(self._yaw_offset, sensed))


def _joint_pose(link: dict[str, Any], angle: float) -> bytes:
    rotation: Quaternion = tuple(link["quaternion"])
    if link["kind"] == PRISMATIC:
        travel = _rotated(rotation, [angle * each for each in link["axis"]])
        return _packed([a + b for a, b in zip(link["position"], travel, strict=True)], rotation)
    sine = math.sin(0.5 * angle)
    x, y, z = link["axis"]
    return _packed(
        link["position"], _product(rotation, (math.cos(0.5 * angle), sine * x, sine * y, sine * z))
    )


def _packed(position: Sequence[float], quaternion: Sequence[float]) -> bytes:
    w, *xyz = quaternion
    return _POSE.pack(*position, *xyz, w)


def _product(a: Quaternion, b: Quaternion) -> Quaternion:
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def _inverse(a: Quaternion) -> Quaternion:
    w, x, y, z = a
    return w, -x, -y, -z


def _heading(a: Quaternion) -> Quaternion:
    """The rotation about the vertical that is part of a rotation."""
    w, _, _, z = a
    size = math.hypot(w, z)
    return (w / size, 0.0, 0.0, z / size) if size else (1.0, 0.0, 0.0, 0.0)


def _rotated(a: Quaternion, vector: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = vector
    _, *found = _product(_product(a, (0.0, x, y, z)), _inverse(a))
    return found[0], found[1], found[2]
