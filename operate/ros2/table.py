"""Names of a run's topics, services and action in ROS 2, for both back ends. Uses only the standard library.

Names are relative to the node's namespace, those with `~` to the node; `/tf` and `/tf_static` are absolute.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

NODE = "footfall"
SCAN_NODE = f"{NODE}_height_scan"  # node of the separate bridge process for height scans
ODOM, BASE = "odom", "base_link"  # REP 105


class Published(NamedTuple):
    """A topic of the feed (type and quality of service: deploy/telemetry/topics.py), with its name in ROS."""

    feed: str
    name: str
    rate_hz: float = math.inf  # maximum; additional messages are skipped
    about: str = ""


class Subscribed(NamedTuple):
    """A topic with commands for the run. The newest message counts."""

    name: str
    kind: str
    key: str  # key of the resulting request, see `steering_socket.py`
    about: str
    reliable: bool = True  # False accepts best-effort publishers, too


class Service(NamedTuple):
    """A service; only with the `rclpy` back end: services do not work between DDS implementations."""

    name: str
    kind: str
    about: str
    request: Mapping[str, Any] = {}  # request sent to the run, see `steering_socket.py`


PUBLISHED = (
    Published("/robot_description", "robot_description", about="URDF made from the MJCF; latched"),
    Published("/joint_states", "joint_states", 200.0, "measured position, velocity and torque"),
    Published("/joint_commands", "joint_commands", 200.0, "position, velocity and torque as sent"),
    Published("/imu/data", "imu/data", 200.0, "in `imu_link`"),
    Published("/odom", "odom", 50.0, "`base_link` in `odom`; velocities in `base_link`"),
    Published("/tf", "/tf", 50.0, "`odom` to `base_link`, and the links"),
    Published("/tf_static", "/tf_static", about="links without a joint; latched"),
    Published("/contacts", "foot_contacts", 50.0, "probability that each foot stands, 0 to 1"),
    Published("/markers", "markers", 20.0, "centre of mass, capture point, footholds, forces, velocities"),
    Published("/battery_state", "battery_state", 1.0, "of robots with a battery in `robot.yaml`"),
    Published("/diagnostics", "/diagnostics", about="state, faults, motors, loop timing"),
    Published("/rosout", "/rosout", about="changes of state, faults, notes"),
    Published("/cmd_vel", "~/command", 50.0, "velocity command of the policy, after clipping"),
    Published("/state", "~/state", about="of the supervisor; latched"),
    Published("/notes", "~/notes", about="what was refused, clipped or changed"),
)

TWIST, TWIST_STAMPED = "geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped"
_EMPTY, _TEXT, _NUMBER = "std_msgs/msg/Empty", "std_msgs/msg/String", "std_msgs/msg/Float64"
CMD_VEL = Subscribed(
    "cmd_vel", TWIST, "velocity", "forward and leftward m/s, yaw rad/s; 0.5 s of silence is zero", False
)
STOP = Subscribed("~/stop", _EMPTY, "stop", "stops the run: latched")
CHOSEN = (
    Subscribed("~/behaviour", _TEXT, "behaviour", "`walk`, `stand`, `lie_down` or, after a fall, `get_up`"),
    Subscribed("~/wish", _TEXT, "behaviour", "former name of `~/behaviour`"),
    Subscribed("~/gait", _TEXT, "gait", "name of a gait of the current policy"),
    Subscribed("~/policy", _TEXT, "policy", "name of a policy of this run"),
)
SETTING = Subscribed("~/setting/{}", _NUMBER, "settings", "a live setting by its name")
HEIGHT_SCAN = Subscribed(
    "height_scan",
    "std_msgs/msg/Float32MultiArray",
    "heights",
    "with `--height-scan ros2`: m above the base's origin, in the order of the policy's grid; NaN is unknown",
    False,
)
SUBSCRIBED = (CMD_VEL, STOP, *CHOSEN, SETTING, HEIGHT_SCAN)


def velocity_kinds(stamped: bool) -> tuple[str, str]:
    """The type of `cmd_vel`, and the type that it must not have."""
    return (TWIST_STAMPED, TWIST) if stamped else (TWIST, TWIST_STAMPED)


def other_type(topic: str, expected: str, found: str) -> str:
    """Advice, in one line, for velocities of the wrong type."""
    option = "stamped" if found == TWIST_STAMPED else "twist"
    return f"{topic} is {found}, but {expected} is expected: start the run with --from ros2:{option}"


TRIGGER = "std_srvs/srv/Trigger"
SERVICES = (
    Service("~/stop", TRIGGER, "stops the run: latched", {"stop": "service"}),
    Service("~/walk", TRIGGER, "follow `cmd_vel`", {"behaviour": "walk"}),
    Service("~/stand", TRIGGER, "stand, whatever `cmd_vel` is", {"behaviour": "stand"}),
    Service("~/lie_down", TRIGGER, "lie down and end the run", {"behaviour": "lie_down"}),
    Service("~/get_up", TRIGGER, "get up after a fall, in a run with `--recover`", {"behaviour": "get_up"}),
    Service("~/take_over", TRIGGER, "take control, whoever has it", {"take_over": True}),
)
CHOICES = {  # one service per name offered by the run
    "gait": Service("~/gait/{}", TRIGGER, "change to a gait of the current policy"),
    "policy": Service("~/policy/{}", TRIGGER, "change to a policy of this run"),
}
WAVE_GAIT = "wave"
WAVE = Service("~/wave", "std_srvs/srv/SetBool", "true is the gait `wave`, false the first other one")
FOLLOW_PATH = Service("~/follow_path", "nav2_msgs/action/FollowPath", "walk along a path in `odom`")


def in_name(text: str) -> str:
    """Convert a text to a part of a ROS name: anything but letters, digits and `_` becomes `_`."""
    plain = "".join(each if each.isascii() and each.isalnum() else "_" for each in text)
    return f"_{plain}" if plain[:1].isdigit() else plain


def absolute(name: str) -> str:
    """A name of this table for a node in the root namespace."""
    return f"/{NODE}{name[1:]}" if name.startswith("~") else f"/{name.lstrip('/')}"
