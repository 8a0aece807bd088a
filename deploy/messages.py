"""ROS 2 messages as a log holds them: their definitions, and their bytes in CDR.

A run's messages never change their shape, so that each is a template with gaps, and writing one is copying
the numbers' bytes into it. Encoding: OMG's Common Data Representation (DDS-XTypes 1.3, 7.4.1, version 1),
little-endian, aligned from behind the four bytes of the head.
"""

import struct
from functools import lru_cache

_TIME = """MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec"""

_HEADER = """MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id"""

_VECTOR = """MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z"""

_QUATERNION = """MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1"""

_TWIST = """MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular"""

_POINT = """MSG: geometry_msgs/Point
float64 x
float64 y
float64 z"""

_POSE = """MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation"""

_POSE_WITH_COVARIANCE = """MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance"""

_TWIST_WITH_COVARIANCE = """MSG: geometry_msgs/TwistWithCovariance
geometry_msgs/Twist twist
float64[36] covariance"""

_ODOMETRY = """std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist"""

_LAYOUT = """MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset"""

_DIMENSION = """MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride"""

_JOINT_STATE = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort"""

_IMU = """std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance"""


def _schema(*parts: str) -> str:
    return f"\n{'=' * 80}\n".join(parts)


SCHEMAS = {
    "sensor_msgs/msg/JointState": _schema(_JOINT_STATE, _HEADER, _TIME),
    "sensor_msgs/msg/Imu": _schema(_IMU, _HEADER, _TIME, _QUATERNION, _VECTOR),
    "geometry_msgs/msg/TwistStamped": _schema(
        "std_msgs/Header header\ngeometry_msgs/Twist twist", _HEADER, _TIME, _TWIST, _VECTOR
    ),
    "nav_msgs/msg/Odometry": _schema(
        _ODOMETRY,
        _HEADER,
        _TIME,
        _POSE_WITH_COVARIANCE,
        _POSE,
        _POINT,
        _QUATERNION,
        _TWIST_WITH_COVARIANCE,
        _TWIST,
        _VECTOR,
    ),
    "std_msgs/msg/String": "string data",
    "std_msgs/msg/Float32MultiArray": _schema(
        "std_msgs/MultiArrayLayout layout\nfloat32[] data", _LAYOUT, _DIMENSION
    ),
    "std_msgs/msg/Float64MultiArray": _schema(
        "std_msgs/MultiArrayLayout layout\nfloat64[] data", _LAYOUT, _DIMENSION
    ),
}

TOPICS = {
    "/joint_states": "sensor_msgs/msg/JointState",  # readings
    "/joint_commands": "sensor_msgs/msg/JointState",  # targets and feed-forward torque that went out
    "/joint_gains": "std_msgs/msg/Float64MultiArray",  # stiffness and damping that went out
    "/imu": "sensor_msgs/msg/Imu",
    "/reading_ages": "std_msgs/msg/Float64MultiArray",  # of each motor's reading and of the IMU's, s
    "/motor_health": "std_msgs/msg/Float64MultiArray",  # temperatures, voltages, error codes
    "/cmd_vel": "geometry_msgs/msg/TwistStamped",
    "/odom": "nav_msgs/msg/Odometry",  # estimated pose and velocity of the base
    "/contacts": "std_msgs/msg/Float64MultiArray",  # probability that each foot stands
    "/footholds": "std_msgs/msg/Float64MultiArray",  # where the policy plans to put each foot that swings, m
    "/state": "std_msgs/msg/String",
    "/notes": "std_msgs/msg/String",  # what was changed of what was asked for
    "/policy/observation": "std_msgs/msg/Float32MultiArray",  # of the network
    "/policy/action": "std_msgs/msg/Float32MultiArray",  # of the network
    "/policy/inputs": "std_msgs/msg/Float64MultiArray",  # everything that the policy was given, exactly
    "/policy/command": "std_msgs/msg/Float64MultiArray",  # its decision, exactly
}

_DOUBLE, _FLOAT = 8, 4


class Template:
    """A message in which only the numbers change."""

    def __init__(self) -> None:
        self._bytes = bytearray(b"\x00\x01\x00\x00")
        self._gaps: list[slice] = []
        self._stamped = False

    def stamp(self, frame: str = "") -> "Template":
        """A std_msgs/Header."""
        self._stamped = True
        self._bytes += bytes(8)
        return self.text(frame)

    def text(self, value: str) -> "Template":
        content = value.encode() + b"\x00"
        self.count(len(content))
        self._bytes += content
        return self

    def count(self, value: int) -> "Template":
        self._align(4)
        self._bytes += struct.pack("<I", value)
        return self

    def gap(self, numbers: int, size: int = _DOUBLE) -> "Template":
        """Room for some numbers of `size` bytes."""
        if numbers:
            self._align(size)
            start = len(self._bytes)
            self._bytes += bytes(numbers * size)
            self._gaps.append(slice(start, len(self._bytes)))
        return self

    def zeros(self, numbers: int) -> "Template":
        """That many float64 zeros, which stay."""
        self.gap(numbers)
        self._gaps.pop()
        return self

    def fill(self, time_ns: int, *numbers: bytes) -> bytes:
        """The message at a time, its gaps filled in their order. A gap takes as many bytes as it has."""
        content = self._bytes
        if self._stamped:
            struct.pack_into("<iI", content, 4, *divmod(time_ns, 10**9))
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
    return Template().stamp("imu").gap(3).gap(1).zeros(9).gap(3).zeros(9).gap(3).zeros(9)


@lru_cache(None)
def twist() -> Template:
    """A geometry_msgs/TwistStamped; gaps: forward and leftward m/s, yaw rad/s."""
    return Template().stamp("base").gap(2).zeros(1).zeros(2).gap(1)


@lru_cache(None)
def odometry() -> Template:
    """A nav_msgs/Odometry from frame `odom` to `base`; one gap of 85 numbers.

    Position (3), orientation x, y, z, w, covariance (36) of x, y, z and of the turns about them; velocity
    (3), angular velocity (3), their covariance (36).
    """
    return Template().stamp("odom").text("base").gap(3 + 4 + 36 + 3 + 3 + 36)


@lru_cache(None)
def multi_array(label: str, numbers: int, size: int = _DOUBLE) -> Template:
    """A std_msgs/Float64MultiArray of one dimension, or with `size` 4 a Float32MultiArray; one gap."""
    template = Template().count(1).text(label).count(numbers).count(numbers).count(0)
    return template.count(numbers).gap(numbers, size)


def text(value: str) -> bytes:
    """A std_msgs/String."""
    return Template().text(value).fill(0)
