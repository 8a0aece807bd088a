"""Definitions (`ros2msg`) of the ROS 2 messages in a run's telemetry, included in its log and feed."""

from collections.abc import Iterator

_FIELDS = {
    "builtin_interfaces/Time": """int32 sec
uint32 nanosec""",
    "builtin_interfaces/Duration": """int32 sec
uint32 nanosec""",
    "std_msgs/Header": """builtin_interfaces/Time stamp
string frame_id""",
    "std_msgs/String": "string data",
    "std_msgs/ColorRGBA": """float32 r
float32 g
float32 b
float32 a""",
    "std_msgs/MultiArrayDimension": """string label
uint32 size
uint32 stride""",
    "std_msgs/MultiArrayLayout": """std_msgs/MultiArrayDimension[] dim
uint32 data_offset""",
    "std_msgs/Float32MultiArray": """std_msgs/MultiArrayLayout layout
float32[] data""",
    "std_msgs/Float64MultiArray": """std_msgs/MultiArrayLayout layout
float64[] data""",
    "geometry_msgs/Vector3": """float64 x
float64 y
float64 z""",
    "geometry_msgs/Point": """float64 x
float64 y
float64 z""",
    "geometry_msgs/Quaternion": """float64 x 0
float64 y 0
float64 z 0
float64 w 1""",
    "geometry_msgs/Pose": """geometry_msgs/Point position
geometry_msgs/Quaternion orientation""",
    "geometry_msgs/PoseWithCovariance": """geometry_msgs/Pose pose
float64[36] covariance""",
    "geometry_msgs/Twist": """geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular""",
    "geometry_msgs/TwistWithCovariance": """geometry_msgs/Twist twist
float64[36] covariance""",
    "geometry_msgs/TwistStamped": """std_msgs/Header header
geometry_msgs/Twist twist""",
    "geometry_msgs/Transform": """geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation""",
    "geometry_msgs/TransformStamped": """std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform""",
    "nav_msgs/Odometry": """std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist""",
    "sensor_msgs/JointState": """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort""",
    "sensor_msgs/Imu": """std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance""",
    "sensor_msgs/BatteryState": """std_msgs/Header header
float32 voltage
float32 temperature
float32 current
float32 charge
float32 capacity
float32 design_capacity
float32 percentage
uint8 power_supply_status
uint8 power_supply_health
uint8 power_supply_technology
bool present
float32[] cell_voltage
float32[] cell_temperature
string location
string serial_number""",
    "sensor_msgs/CompressedImage": """std_msgs/Header header
string format
uint8[] data""",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "visualization_msgs/UVCoordinate": """float32 u
float32 v""",
    "visualization_msgs/MeshFile": """string filename
uint8[] data""",
    "visualization_msgs/Marker": """std_msgs/Header header
string ns
int32 id
int32 type
int32 action
geometry_msgs/Pose pose
geometry_msgs/Vector3 scale
std_msgs/ColorRGBA color
builtin_interfaces/Duration lifetime
bool frame_locked
geometry_msgs/Point[] points
std_msgs/ColorRGBA[] colors
string texture_resource
sensor_msgs/CompressedImage texture
visualization_msgs/UVCoordinate[] uv_coordinates
string text
string mesh_resource
visualization_msgs/MeshFile mesh_file
bool mesh_use_embedded_materials""",
    "visualization_msgs/MarkerArray": "visualization_msgs/Marker[] markers",
    "diagnostic_msgs/KeyValue": """string key
string value""",
    "diagnostic_msgs/DiagnosticStatus": """byte level
string name
string message
string hardware_id
diagnostic_msgs/KeyValue[] values""",
    "diagnostic_msgs/DiagnosticArray": """std_msgs/Header header
diagnostic_msgs/DiagnosticStatus[] status""",
    "rcl_interfaces/Log": """builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line""",
    "can_msgs/Frame": """std_msgs/Header header
uint32 id
bool is_rtr
bool is_extended
bool is_error
uint8 dlc
uint8[8] data""",
    "ros2_socketcan_msgs/FdFrame": """std_msgs/Header header
uint32 id
bool is_extended
bool is_error
uint8 len
uint8[<=64] data""",
}


def definition(kind: str) -> str:
    """Definition of a message, including those of its parts, for example of `std_msgs/msg/String`."""
    name = kind.replace("/msg/", "/")
    parts = {part: f"MSG: {part}\n{_FIELDS[part]}" for part in _parts(name)}
    return f"\n{'=' * 80}\n".join([_FIELDS[name], *parts.values()])


def _parts(name: str) -> Iterator[str]:
    """Messages used by a message, outermost first; some repeated."""
    for line in _FIELDS[name].splitlines():
        kind = line.split()[0].partition("[")[0]
        if kind in _FIELDS:
            yield kind
            yield from _parts(kind)
