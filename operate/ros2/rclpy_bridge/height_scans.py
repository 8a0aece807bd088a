"""The bridge process for height scans: `python -m footfall.operate.ros2.rclpy_bridge.height_scans PORT`."""

import sys
from collections.abc import Sequence
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from footfall.operate.ros2.rclpy_bridge.publishing import message_type
from footfall.operate.ros2.rclpy_bridge.spinning import spin_node
from footfall.operate.ros2.reading import report_ready
from footfall.operate.ros2.scan_sender import scan_sender
from footfall.operate.ros2.table import HEIGHT_SCAN, SCAN_NODE


def main(arguments: Sequence[str]) -> None:
    """Forward scans until the parent process ends this one; arguments: a port, and those for ROS."""
    port, *ros_arguments = arguments
    with scan_sender(int(port)) as send:

        def take(message: Any) -> None:
            send(message.data[message.layout.data_offset :])

        def begin(node: Node) -> None:
            qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
            node.create_subscription(message_type(HEIGHT_SCAN.kind), HEIGHT_SCAN.name, take, qos)
            report_ready(rclpy.try_shutdown)

        spin_node(SCAN_NODE, ros_arguments, begin)


if __name__ == "__main__":
    main(sys.argv[1:])
