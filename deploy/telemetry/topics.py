"""Topics of a run's telemetry, with their ROS 2 message types and quality of service."""

from typing import NamedTuple

_FOREVER = "{sec: 9223372036, nsec: 854775807}"


class Topic(NamedTuple):
    """Properties of a topic. All topics are reliable and keep the last `depth` messages."""

    kind: str  # message type
    latched: bool = False  # late subscribers get the last message, too (transient local)
    depth: int = 10

    @property
    def qos_profile(self) -> str:
        """Its quality of service in the format of `rosbag2`, one profile in YAML."""
        durability, depth = ("transient_local", 1) if self.latched else ("volatile", self.depth)
        return f"""- history: keep_last
  depth: {depth}
  reliability: reliable
  durability: {durability}
  deadline: {_FOREVER}
  lifespan: {_FOREVER}
  liveliness: automatic
  liveliness_lease_duration: {_FOREVER}
  avoid_ros_namespace_conventions: false
"""


TOPICS = {
    "/robot_description": Topic("std_msgs/msg/String", latched=True),  # URDF
    "/joint_states": Topic("sensor_msgs/msg/JointState"),  # readings
    "/joint_commands": Topic("sensor_msgs/msg/JointState"),  # position targets, feed-forward torques
    "/joint_gains": Topic("std_msgs/msg/Float64MultiArray"),  # stiffness and damping as sent
    "/imu/data": Topic("sensor_msgs/msg/Imu"),
    "/foot_forces": Topic("std_msgs/msg/Float64MultiArray"),  # on each foot, N; NaN if unknown
    "/reading_ages": Topic("std_msgs/msg/Float64MultiArray"),  # of each motor and of the IMU, s
    "/motor_health": Topic("std_msgs/msg/Float64MultiArray", latched=True),  # °C, V, error codes
    "/cmd_vel": Topic("geometry_msgs/msg/TwistStamped"),  # the policy's command
    "/odom": Topic("nav_msgs/msg/Odometry"),  # estimated pose and velocity of the base
    "/contacts": Topic("std_msgs/msg/Float64MultiArray"),  # probability that each foot stands
    "/footholds": Topic("std_msgs/msg/Float64MultiArray"),  # planned positions of swing feet, m
    "/tf": Topic("tf2_msgs/msg/TFMessage", depth=100),
    "/tf_static": Topic("tf2_msgs/msg/TFMessage", latched=True),
    "/markers": Topic("visualization_msgs/msg/MarkerArray"),  # balance, footholds, forces, velocities
    "/battery_state": Topic("sensor_msgs/msg/BatteryState"),
    "/diagnostics": Topic("diagnostic_msgs/msg/DiagnosticArray"),
    "/rosout": Topic("rcl_interfaces/msg/Log", depth=1000),  # changes of state, and notes
    "/loop_timing": Topic("std_msgs/msg/Float64MultiArray"),  # duration and lateness of a tick, us
    "/from_can_bus": Topic("can_msgs/msg/Frame", depth=1000),  # frame_id: name of the bus
    "/to_can_bus": Topic("can_msgs/msg/Frame", depth=1000),
    "/from_can_bus_fd": Topic("ros2_socketcan_msgs/msg/FdFrame", depth=1000),  # CAN FD frames
    "/to_can_bus_fd": Topic("ros2_socketcan_msgs/msg/FdFrame", depth=1000),
    "/state": Topic("std_msgs/msg/String", latched=True),
    "/notes": Topic("std_msgs/msg/String"),  # for example changed requests
    "/orders": Topic("std_msgs/msg/String"),  # JSON: operator, and requests to walk, stand or stop
    "/policy/changes": Topic("std_msgs/msg/String"),  # JSON: changes of policy, gait, settings
    "/policy/applied": Topic("std_msgs/msg/String", latched=True),  # JSON: gait and settings in effect
    "/policy/observation": Topic("std_msgs/msg/Float32MultiArray"),  # input of the network
    "/policy/action": Topic("std_msgs/msg/Float32MultiArray"),  # output of the network
    "/policy/inputs": Topic("std_msgs/msg/Float64MultiArray"),  # complete exact input of the policy
    "/policy/command": Topic("std_msgs/msg/Float64MultiArray"),  # exact output of the policy
}
