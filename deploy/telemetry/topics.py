"""Topics of a run's telemetry: their ROS 2 messages and the quality of service that they are offered with."""

from typing import NamedTuple

_FOREVER = "{sec: 9223372036, nsec: 854775807}"


class Topic(NamedTuple):
    """How a topic is published. All are reliable and keep the last `depth` messages."""

    kind: str  # of message
    latched: bool = False  # the last message goes to late subscribers, too (transient local)
    depth: int = 10

    @property
    def qos_profile(self) -> str:
        """Its quality of service as `rosbag2` stores it, one profile in YAML."""
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
    "/joint_commands": Topic("sensor_msgs/msg/JointState"),  # targets and feed-forward torque that went out
    "/joint_gains": Topic("std_msgs/msg/Float64MultiArray"),  # stiffness and damping that went out
    "/imu/data": Topic("sensor_msgs/msg/Imu"),
    "/foot_forces": Topic("std_msgs/msg/Float64MultiArray"),  # that press on the feet, N; NaN for unknown
    "/reading_ages": Topic("std_msgs/msg/Float64MultiArray"),  # of each motor's reading and of the IMU's, s
    "/motor_health": Topic("std_msgs/msg/Float64MultiArray", latched=True),  # °C, V, error codes
    "/cmd_vel": Topic("geometry_msgs/msg/TwistStamped"),  # the policy's command
    "/odom": Topic("nav_msgs/msg/Odometry"),  # estimated pose and velocity of the base
    "/contacts": Topic("std_msgs/msg/Float64MultiArray"),  # probability that each foot stands
    "/footholds": Topic("std_msgs/msg/Float64MultiArray"),  # where the policy plans to put swinging feet, m
    "/tf": Topic("tf2_msgs/msg/TFMessage", depth=100),
    "/tf_static": Topic("tf2_msgs/msg/TFMessage", latched=True),
    "/markers": Topic("visualization_msgs/msg/MarkerArray"),  # balance, footholds, forces, velocities
    "/battery_state": Topic("sensor_msgs/msg/BatteryState"),
    "/diagnostics": Topic("diagnostic_msgs/msg/DiagnosticArray"),
    "/rosout": Topic("rcl_interfaces/msg/Log", depth=1000),  # changes of state, and notes
    "/loop_timing": Topic("std_msgs/msg/Float64MultiArray"),  # work of a tick and its lateness, us
    "/from_can_bus": Topic("can_msgs/msg/Frame", depth=1000),  # frame_id: the bus
    "/to_can_bus": Topic("can_msgs/msg/Frame", depth=1000),
    "/from_can_bus_fd": Topic("ros2_socketcan_msgs/msg/FdFrame", depth=1000),  # frames of CAN FD
    "/to_can_bus_fd": Topic("ros2_socketcan_msgs/msg/FdFrame", depth=1000),
    "/state": Topic("std_msgs/msg/String", latched=True),
    "/notes": Topic("std_msgs/msg/String"),  # what was changed of what was asked for
    "/orders": Topic("std_msgs/msg/String"),  # JSON: who steers, who wants it to walk, to stand, to stop
    "/policy/changes": Topic("std_msgs/msg/String"),  # JSON: changes of policy, gait, settings, and by whom
    "/policy/applied": Topic("std_msgs/msg/String", latched=True),  # JSON: gait and settings that act now
    "/policy/observation": Topic("std_msgs/msg/Float32MultiArray"),  # of the network
    "/policy/action": Topic("std_msgs/msg/Float32MultiArray"),  # of the network
    "/policy/inputs": Topic(
        "std_msgs/msg/Float64MultiArray"
    ),  # everything that the policy was given, exactly
    "/policy/command": Topic("std_msgs/msg/Float64MultiArray"),  # its decision, exactly
}
