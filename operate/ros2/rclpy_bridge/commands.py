"""Forwards commands from topics to the run."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from footfall.operate.ros2.link import Link
from footfall.operate.ros2.rclpy_bridge.publishing import message_type
from footfall.operate.ros2.table import (
    CHOSEN,
    CMD_VEL,
    SETTING,
    STOP,
    Subscribed,
    other_type,
    velocity_kinds,
)

CHECK_INTERVAL_S = 1.0  # interval of checks for publishers of velocities of the wrong type


class Commands:
    """Subscriptions to `cmd_vel` and other topics with commands."""

    def __init__(self, node: Node, link: Link, stamped: bool) -> None:
        """Subscribe; with `stamped`, velocities are TwistStamped."""
        self._node, self._link = node, link
        self._kind, self._other = velocity_kinds(stamped)
        self._stopped = self._warned = False
        self._settings: dict[str, Any] = {}
        self._subscribe(CMD_VEL._replace(kind=self._kind), self._stamped if stamped else self._velocity, 1)
        self._subscribe(STOP, self._stop)
        for topic in CHOSEN:
            self._subscribe(topic, partial(self._choose, topic.key))
        node.create_timer(CHECK_INTERVAL_S, self._check_publishers)

    def offer(self, settings: Iterable[str]) -> None:
        """Listen to the topics of these live settings from now on."""
        for name in set(self._settings) - set(settings):
            self._node.destroy_subscription(self._settings.pop(name))
        for name in set(settings) - set(self._settings):
            topic = SETTING._replace(name=SETTING.name.format(name))
            self._settings[name] = self._subscribe(topic, partial(self._setting, name))

    def _subscribe(self, topic: Subscribed, take: Callable[[Any], None], depth: int = 10) -> Any:
        reliability = ReliabilityPolicy.RELIABLE if topic.reliable else ReliabilityPolicy.BEST_EFFORT
        qos = QoSProfile(depth=depth, reliability=reliability)
        return self._node.create_subscription(message_type(topic.kind), topic.name, take, qos)

    def _velocity(self, twist: Any) -> None:
        self._link.post(velocity=[twist.linear.x, twist.linear.y, twist.angular.z])

    def _stamped(self, message: Any) -> None:
        """Forward a stamped velocity. Its stamp is ignored: two computers' clocks may differ."""
        self._velocity(message.twist)

    def _stop(self, _: Any) -> None:
        """Forward the first stop only: a second one has a stronger effect on the run."""
        if not self._stopped:
            self._stopped = True
            self._link.post(stop=f"topic {self._node.resolve_topic_name(STOP.name)}")

    def _choose(self, key: str, message: Any) -> None:
        self._link.post(**{key: message.data})

    def _setting(self, name: str, message: Any) -> None:
        self._link.post(settings={name: message.data})

    def _check_publishers(self) -> None:
        topic = self._node.resolve_topic_name(CMD_VEL.name)
        found = self._node.get_publishers_info_by_topic(topic)
        if not self._warned and self._other in [each.topic_type for each in found]:
            self._warned = True
            line = other_type(topic, self._kind, self._other)
            self._node.get_logger().error(line)
            self._link.post(note=line)
