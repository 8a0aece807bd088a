"""Encodes a run's ROS 2 messages as CDR.

The layout of each message of a run is constant. So each message has a template with gaps, and encoding means
to copy the numbers' bytes into the gaps. Encoding: OMG's Common Data Representation (DDS-XTypes 1.3, 7.4.1,
version 1), little-endian, aligned relative to the end of the four-byte header.
"""

import math
import struct
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import NamedTuple

BASE, IMU, ODOM = "base_link", "imu_link", "odom"  # frames, with the names of REP 105

DISCHARGING = 2  # status of a BatteryState
INFO, WARN, ERROR = 20, 30, 40  # levels of a Log
FINE, WARNING, BAD = 0, 1, 2  # levels of a DiagnosticStatus

_DOUBLE = 8


class Diagnosis(NamedTuple):
    """A diagnostic_msgs/DiagnosticStatus."""

    level: int
    name: str
    summary: str
    values: Mapping[str, str]


class Template:
    """A message in which only numbers change."""

    def __init__(self) -> None:
        self._bytes = bytearray(b"\x00\x01\x00\x00")
        self._gaps: list[slice] = []
        self._stamps: list[int] = []  # positions of time stamps

    def stamp(self, frame: str = "") -> "Template":
        """Append a std_msgs/Header."""
        self._align(4)
        self._stamps.append(len(self._bytes))
        self._bytes += bytes(8)
        return self.text(frame)

    def text(self, value: str) -> "Template":
        """Append a string with its length."""
        content = value.encode() + b"\x00"
        self.count(len(content))
        self._bytes += content
        return self

    def count(self, value: int) -> "Template":
        """Append a uint32, such as the length of the following sequence."""
        self._align(4)
        self._bytes += struct.pack("<I", value)
        return self

    def gap(self, count: int, size: int = _DOUBLE) -> "Template":
        """Append a gap for `count` numbers of `size` bytes."""
        if count:
            self._align(size)
            start = len(self._bytes)
            self._bytes += bytes(count * size)
            self._gaps.append(slice(start, len(self._bytes)))
        return self

    def put(self, layout: str, *values: float) -> "Template":
        """Append numbers of one type, given as in `struct`."""
        self._align(struct.calcsize(layout))
        self._bytes += struct.pack(f"<{len(values)}{layout}", *values)
        return self

    def zeros(self, count: int) -> "Template":
        """Append `count` constant float64 zeros."""
        self.gap(count)
        self._gaps.pop()
        return self

    def done(self) -> bytes:
        """The message, if it has no gaps or stamps."""
        return bytes(self._bytes)

    def fill(self, time_ns: int, *numbers: bytes) -> bytes:
        """The message with a time and numbers for the gaps in order, each of its gap's size."""
        content = self._bytes
        for offset in self._stamps:
            struct.pack_into("<iI", content, offset, *divmod(time_ns, 10**9))
        for gap, part in zip(self._gaps, numbers, strict=True):
            content[gap] = part
        return bytes(content)

    def _align(self, size: int) -> None:
        self._bytes += bytes((4 - len(self._bytes)) % size)


@lru_cache(None)
def joint_state(names: tuple[str, ...]) -> Template:
    """A sensor_msgs/JointState; gaps: position rad, velocity rad/s, effort N m, each (n,)."""
    template = Template().stamp().count(len(names))
    for name in names:
        template.text(name)
    for _ in range(3):
        template.count(len(names)).gap(len(names))
    return template


@lru_cache(None)
def imu() -> Template:
    """A sensor_msgs/Imu; gaps: quaternion x, y, z, its w, gyro rad/s, acceleration m/s². No covariances."""
    return Template().stamp(IMU).gap(3).gap(1).zeros(9).gap(3).zeros(9).gap(3).zeros(9)


@lru_cache(None)
def twist() -> Template:
    """A geometry_msgs/TwistStamped; gaps: forward and leftward m/s, yaw rad/s."""
    return Template().stamp(BASE).gap(2).zeros(1).zeros(2).gap(1)


@lru_cache(None)
def odometry() -> Template:
    """A nav_msgs/Odometry from frame `odom` to `base_link`; one gap of 85 numbers.

    Position (3), orientation x, y, z, w, covariance (36) of x, y, z and the rotations about these axes;
    velocity (3), angular velocity (3), their covariance (36).
    """
    return Template().stamp(ODOM).text(BASE).gap(3 + 4 + 36 + 3 + 3 + 36)


@lru_cache(None)
def transforms(frames: tuple[tuple[str, str], ...]) -> Template:
    """A tf2_msgs/TFMessage of (parent, child) frames; gap for each: x, y, z, m, quaternion x, y, z, w."""
    template = Template().count(len(frames))
    for parent, child in frames:
        template.stamp(parent).text(child).gap(7)
    return template


@lru_cache(None)
def multi_array(label: str, count: int, size: int = _DOUBLE) -> Template:
    """A one-dimensional std_msgs/Float64MultiArray, or with `size` 4 a Float32MultiArray; one gap."""
    template = Template().count(1).text(label).count(count).count(count).count(0)
    return template.count(count).gap(count, size)


def text(value: str) -> bytes:
    """A std_msgs/String."""
    return Template().text(value).done()


@lru_cache(None)
def battery() -> Template:
    """A sensor_msgs/BatteryState; gaps of float32: voltage V, current A (negative: drawn), charge 0 to 1."""
    nan = math.nan
    template = Template().stamp().gap(1, 4).put("f", nan).gap(1, 4).put("f", nan, nan, nan).gap(1, 4)
    template.put("B", DISCHARGING, 0, 0, 1)
    return template.count(0).count(0).text("").text("")


def event(time_ns: int, level: int, value: str) -> bytes:
    """An rcl_interfaces/Log."""
    template = Template().put("i", time_ns // 10**9).put("I", time_ns % 10**9).put("B", level)
    return template.text("footfall").text(value).text("").text("").count(0).done()


@lru_cache(None)
def can_frame(bus: str, extended: bool, length: int) -> Template:
    """A can_msgs/Frame; gaps: identifier (4 bytes), data (8 bytes)."""
    return Template().stamp(bus).gap(1, 4).put("B", 0, extended, 0, length).gap(8, 1)


@lru_cache(None)
def can_fd_frame(bus: str, extended: bool, length: int) -> Template:
    """A ros2_socketcan_msgs/FdFrame; gaps: identifier (4 bytes), data (64 bytes, zeros after the length)."""
    return Template().stamp(bus).gap(1, 4).put("B", extended, 0, length).count(64).gap(64, 1)


def diagnostics(time_ns: int, hardware: str, diagnoses: Iterable[Diagnosis]) -> bytes:
    """A diagnostic_msgs/DiagnosticArray."""
    statuses = list(diagnoses)
    template = Template().stamp().count(len(statuses))
    for level, name, summary, values in statuses:
        template.put("B", level).text(name).text(summary).text(hardware).count(len(values))
        for key, value in values.items():
            template.text(key).text(value)
    return template.fill(time_ns)
