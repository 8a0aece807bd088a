"""ROS 2 message definitions as MCAP schemas carry them: each with all that it depends on."""

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
    "/joint_commands": "sensor_msgs/msg/JointState",  # targets that went out
    "/imu": "sensor_msgs/msg/Imu",
    "/cmd_vel": "geometry_msgs/msg/TwistStamped",
    "/state": "std_msgs/msg/String",
    "/notes": "std_msgs/msg/String",  # what had to be changed of what was asked for
    "/policy/observation": "std_msgs/msg/Float32MultiArray",  # what the network saw
    "/policy/action": "std_msgs/msg/Float32MultiArray",  # what it answered
    "/policy/inputs": "std_msgs/msg/Float64MultiArray",  # all that the policy was handed, exactly
    "/policy/command": "std_msgs/msg/Float64MultiArray",  # what it decided, exactly
}

_NO_COVARIANCE = [0.0] * 9


def header(time_ns: int, frame: str = "") -> dict:
    """A std_msgs/Header."""
    return {"stamp": {"sec": time_ns // 10**9, "nanosec": time_ns % 10**9}, "frame_id": frame}


def vector(values: list[float]) -> dict:
    """A geometry_msgs/Vector3."""
    return {"x": values[0], "y": values[1], "z": values[2]}


def joint_state(
    time_ns: int,
    names: list[str],
    position: list[float],
    velocity: list[float],
    effort: list[float],
) -> dict:
    """A sensor_msgs/JointState: rad, rad/s, N m."""
    return {
        "header": header(time_ns),
        "name": names,
        "position": position,
        "velocity": velocity,
        "effort": effort,
    }


def imu(time_ns: int, quaternion: list[float], gyro: list[float], acceleration: list[float]) -> dict:
    """A sensor_msgs/Imu; the quaternion comes as w x y z."""
    w, x, y, z = quaternion
    return {
        "header": header(time_ns, "imu"),
        "orientation": {"x": x, "y": y, "z": z, "w": w},
        "orientation_covariance": _NO_COVARIANCE,
        "angular_velocity": vector(gyro),
        "angular_velocity_covariance": _NO_COVARIANCE,
        "linear_acceleration": vector(acceleration),
        "linear_acceleration_covariance": _NO_COVARIANCE,
    }


def twist(time_ns: int, command: list[float]) -> dict:
    """A geometry_msgs/TwistStamped from forward m/s, leftward m/s and yaw rad/s."""
    forward, leftward, yaw = command
    return {
        "header": header(time_ns, "base"),
        "twist": {"linear": vector([forward, leftward, 0.0]), "angular": vector([0.0, 0.0, yaw])},
    }


def multi_array(values: list[float], label: str) -> dict:
    """A std_msgs/Float32MultiArray or Float64MultiArray of one dimension."""
    size = len(values)
    dimension = {"label": label, "size": size, "stride": size}
    return {"layout": {"dim": [dimension], "data_offset": 0}, "data": values}
