"""Checks of a run in ROS 2 without requests: graph and values of messages. Part of `looks.py`."""

import sys
import time
import xml.etree.ElementTree as ET
from importlib import import_module
from typing import Any

from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from peer import Peer, report
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import String

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RATES = {"/joint_states": 200.0, "/imu/data": 200.0, "/odom": 50.0, "/tf": 50.0}
WALKING_TIMEOUT_S = 60.0


def stamp_s(message: Any) -> float:
    """Time stamp of a message's header, or of its first transform, s."""
    stamp = (message.transforms[0] if hasattr(message, "transforms") else message).header.stamp
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def rate_hz(peer: Peer, topic: str, seconds: float) -> float:
    """Rate of a topic by its time stamps, because messages arrive in bursts on a busy computer."""
    before = len(peer.received[topic])
    peer.spin(seconds)
    stamps = [stamp_s(message) for _, message in peer.received[topic][before:]]
    return (len(stamps) - 1) / (stamps[-1] - stamps[0]) if len(stamps) > 1 else 0.0


def state(peer: Peer) -> str:
    """The supervisor's state in the latest message."""
    latest = peer.latest("/footfall/state")
    return "" if latest is None else str(latest.data)


def look_at_graph(peer: Peer, table: dict[str, Any]) -> None:
    """Check nodes, topics, message types and quality of service."""
    node = peer.node
    peer.until(lambda: "/footfall/state" in dict(node.get_topic_names_and_types()), 40.0)
    peer.until(lambda: "footfall" in node.get_node_names(), 2.0)
    names = node.get_node_names()
    report("node list (without rclpy there is no node)", not table["services"] or "footfall" in names, names)
    expected = {topic for topic, _, _ in table["published"]}
    peer.until(lambda: expected <= set(dict(node.get_topic_names_and_types())), 10.0)
    types = dict(node.get_topic_names_and_types())
    wrong = [t for t, kind, _ in table["published"] if kind not in types.get(t, [])]
    report("topics and their types", not wrong, wrong or f"{len(table['published'])} topics")
    wrong = []
    for topic, kind, latched in table["published"]:
        if topic == "/rosout":  # each node has its own publisher
            continue
        for info in node.get_publishers_info_by_topic(topic):
            quality = info.qos_profile
            latched_now = quality.durability == DurabilityPolicy.TRANSIENT_LOCAL
            reliable = quality.reliability == ReliabilityPolicy.RELIABLE
            if (info.topic_type, latched_now, reliable) != (kind, latched, True):
                wrong.append([topic, info.topic_type, latched_now, reliable])
    report("quality of service", not wrong, wrong or "reliable; latched where the table says so")


def look_at_values(peer: Peer) -> None:
    """Check that latched messages reach late subscribers, and rates and values of the others."""
    peer.listen("/robot_description", String, LATCHED)
    peer.listen("/tf_static", import_module("tf2_msgs.msg").TFMessage, LATCHED)
    peer.listen("/tf", import_module("tf2_msgs.msg").TFMessage, 100)
    for topic, kind in (("/joint_states", JointState), ("/imu/data", Imu), ("/odom", Odometry)):
        peer.listen(topic, kind)
    peer.listen("/footfall/command", TwistStamped)
    peer.listen("/footfall/state", String, LATCHED)
    peer.listen("/footfall/notes", String, 100)
    peer.listen("/rosout", Log, 100)
    peer.until(lambda: peer.latest("/robot_description") and peer.latest("/tf_static"), 10.0)
    description = peer.latest("/robot_description")
    links = (
        [] if description is None else [e.get("name") for e in ET.fromstring(description.data).iter("link")]
    )
    report("latched /robot_description", "base_link" in links, f"{len(links)} links")
    static = peer.latest("/tf_static")
    fixed = [] if static is None else [each.child_frame_id for each in static.transforms]
    report("latched /tf_static", "imu_link" in fixed, fixed)
    walking = peer.until(lambda: "WALKING" in state(peer), WALKING_TIMEOUT_S)
    report("latched state", walking, state(peer))
    for topic, max_hz in RATES.items():
        seen = rate_hz(peer, topic, 2.0)
        report(f"rate of {topic}, Hz (less on a busy computer)", 0.1 < seen / max_hz < 1.1, round(seen, 1))
    joints = peer.latest("/joint_states")
    if joints is None:
        sys.exit("no run found")
    report("joint states", len(joints.name) == len(joints.position) >= 12, joints.name)
    imu = peer.latest("/imu/data")
    report(
        "imu frame and gravity",
        imu.header.frame_id == "imu_link" and 8.0 < imu.linear_acceleration.z < 12.0,
        [imu.header.frame_id, round(imu.linear_acceleration.z, 2)],
    )
    frames = {(each.header.frame_id, each.child_frame_id) for each in peer.latest("/tf").transforms}
    moved = {child for _, child in frames}
    connected = ("odom", "base_link") in frames and set(links) - {"base_link"} <= moved | set(fixed)
    report("frames: odom to base_link to each link", connected, f"{len(moved)} moving, {len(fixed)} fixed")
    age_s = time.time() - stamp_s(peer.latest("/joint_states"))
    report("age of stamps, s (more on a busy computer)", 0.0 < age_s < 5.0, round(age_s, 3))
