"""Publishes a run's feed."""

from importlib import import_module
from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from footfall.deploy.telemetry.feed_reader import FeedMessage
from footfall.deploy.telemetry.topics import TOPICS
from footfall.operate.ros2.table import PUBLISHED
from footfall.operate.ros2.throttle import Throttle


def message_type(kind: str) -> Any:
    """The class of a message type such as `sensor_msgs/msg/Imu`.

    Raises:
        ImportError: its package is not installed.
    """
    package, part, name = kind.split("/")
    return getattr(import_module(f"{package}.{part}"), name)


class Publishing:
    """Publishers for all topics of the table; they publish encoded messages."""

    def __init__(self, node: Node) -> None:
        """Advertise the topics; one whose message package is not installed is skipped with a warning."""
        self._publishers: dict[str, tuple[Publisher, Throttle]] = {}
        for each in PUBLISHED:
            topic = TOPICS[each.feed]
            durability = DurabilityPolicy.TRANSIENT_LOCAL if topic.latched else DurabilityPolicy.VOLATILE
            qos = QoSProfile(
                depth=1 if topic.latched else topic.depth,
                reliability=ReliabilityPolicy.RELIABLE,
                durability=durability,
            )
            try:
                publisher = node.create_publisher(message_type(topic.kind), each.name, qos)
            except ImportError as error:
                node.get_logger().warning(f"no {each.name}: {error}")
                continue
            self._publishers[each.feed] = publisher, Throttle(each.rate_hz)

    def pass_on(self, message: FeedMessage) -> None:
        """Publish a message of the feed if its topic is in the table."""
        found = self._publishers.get(message.channel.topic)
        if found is not None and found[1].due(message.time_ns):
            found[0].publish(message.data)
