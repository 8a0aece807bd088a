"""All ROS interfaces for controlling the run, kept consistent with what the run offers."""

from typing import Any

from rclpy.node import Node

from footfall.operate.ros2.link import Link
from footfall.operate.ros2.rclpy_bridge.commands import Commands
from footfall.operate.ros2.rclpy_bridge.parameters import Parameters
from footfall.operate.ros2.rclpy_bridge.path_action import PathAction
from footfall.operate.ros2.rclpy_bridge.services import Services
from footfall.operate.ros2.table import FOLLOW_PATH

UPDATE_EVERY_S = 0.1


class Steering:
    """The node's interfaces for control."""

    def __init__(self, node: Node, path: str, stamped: bool) -> None:
        """Connect to the run and start listening.

        Args:
            node: the node.
            path: path of the run's steering socket.
            stamped: whether velocities are TwistStamped.
        """
        self._node = node
        self._status: dict[str, Any] = {}
        self._offered: dict[str, Any] = {}
        self.link = Link(path, self._take, self._refused)
        self._commands = Commands(node, self.link, stamped)
        self._services = Services(node, self.link)
        self._parameters = Parameters(node, self.link)
        try:
            self._action: PathAction | None = PathAction(node, self.link)
        except ImportError as error:
            self._action = None
            node.get_logger().warning(f"no {FOLLOW_PATH.name}: {error}")
        node.create_timer(UPDATE_EVERY_S, self._update)

    def _take(self, status: dict[str, Any]) -> None:
        """Called from the link's thread."""
        self._status = status

    def _refused(self, why: str) -> None:
        """Called from the link's thread."""
        self._node.get_logger().warning(why)

    def _update(self) -> None:
        """Adapt to what the run offers, which depends on the policy."""
        if not self._status:
            return
        if self._action is not None:
            self._action.update(self._status)
        offered = {key: self._status[key] for key in ("gaits", "policies", "settings")}
        if offered != self._offered:
            self._offered = offered
            self._commands.offer(offered["settings"])
            self._services.offer(offered["gaits"], offered["policies"])
            self._parameters.offer(offered["settings"])
